// Facets that stand for all about one half vector, in rows of nodes.room: how many there are, then these in order.

struct Pick {
    facet: u32,
    // What it stands for; in the first of a row nothing.
    weight: f32,
}
