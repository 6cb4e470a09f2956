//! GPU device, shader loading and validation, buffers. Everything works without one.
