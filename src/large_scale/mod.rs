//! The large-scale object: meshes with tangents, camera, lights, G-buffer, shading.
