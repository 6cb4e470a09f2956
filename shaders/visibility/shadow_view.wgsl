// One direction's view of the endless tiling. Layout and meaning are those of `ShadowView`
// (src/visibility/shadow_view.rs).

struct View {
    direction: vec3f,
    // Distances to a plane below this are rounding errors.
    tolerance: f32,
    // Texel coordinates of a point: its dot products with these.
    column_from_tile: vec3f,
    columns: u32,
    row_from_tile: vec3f,
    rows: u32,
    // Steps on the base plane from one texel to the next: along columns in xy, along rows in zw.
    plane_from_texel: vec4f,
}

fn texel_of(view: View, p: vec3f) -> vec2f {
    return vec2f(dot(view.column_from_tile, p), dot(view.row_from_tile, p));
}

fn wrap(texel: i32, size: u32) -> u32 {
    let period = i32(size);
    let remainder = texel % period;
    return u32(select(remainder, remainder + period, remainder < 0));
}
