use super::*;
use crate::pipeline::Pipeline;
use crate::scene;

#[test]
fn matrices_hold_the_totals_of_the_slab_and_a_window_is_diagonal() {
    let open =
        |name: &str| Pipeline::new().slab(&scene::open(name, &["quality.preset=draft".to_owned()]).unwrap()).unwrap();
    let window = open("slab_window");
    let klems = Cells::of(&ExportOptions::default());
    let columns = matrix(&window.slab, &KINDS[0], &klems, &|_| true).unwrap();
    for (k, column) in columns.iter().enumerate() {
        for (j, value) in column.iter().enumerate() {
            assert!(j == k || value.max_element() < 1e-3, "{k} {j}: {value}");
        }
    }
    let rough = open("slab_fig3_both");
    for (k, kind) in KINDS.iter().enumerate() {
        let columns = matrix(&rough.slab, kind, &klems, &|_| true).unwrap();
        let i = DVec3::new(0.0, 0.0, 1.0);
        let slab = &rough.slab;
        let total = match k {
            0 | 2 => crate::slab::DiscLobe::transmitted(slab, i, 96).total().x,
            _ => crate::slab::DiscLobe::reflected(slab, i, 96).total().x,
        };
        let flux = flux(&klems, &columns[0]);
        assert!((flux / total - 1.0).abs() < 0.02, "{}: {flux} {total}", kind.name);
    }
}

fn flux(cells: &Cells, column: &[Vec3]) -> f64 {
    let parts = column.iter().enumerate();
    parts.map(|(cell, value)| f64::from(value.x) * cells.projected_solid_angle(cell)).sum()
}

#[test]
fn tensor_trees_hold_the_light_of_each_direction_and_leave_straight_light_in_its_cell() {
    let open = |name: &str| {
        Pipeline::new().slab(&scene::open(name, &["quality.preset=draft".to_owned()]).unwrap()).unwrap().slab
    };
    let (side, squares) = (8, Cells::Squares(8));
    let window = matrix(&open("slab_window"), &KINDS[0], &squares, &|_| true).unwrap();
    for (incident, column) in window.iter().enumerate() {
        assert!(column.iter().enumerate().all(|(cell, value)| cell == incident || value.max_element() < 1e-3));
    }
    // Both faces are alike, so that light from below behaves as light from above.
    let slab = open("slab_fig3_both");
    for kind in &KINDS {
        let columns = matrix(&slab, kind, &squares, &|_| true).unwrap();
        for (x, y) in [(0.1, 0.2), (0.5, -0.3), (-0.6, 0.2)] {
            let cell = tensor_tree::cell(side, x, y);
            let directions = squares.incident(cell);
            let total = |direction: &DVec3| {
                let i = source_of(*direction);
                let lobe = if kind.from_above == kind.to_above {
                    crate::slab::DiscLobe::reflected(&slab, i, 96)
                } else {
                    crate::slab::DiscLobe::transmitted(&slab, i, 96)
                };
                lobe.total().x
            };
            let expected = directions.iter().map(total).sum::<f64>() / directions.len() as f64;
            let found = flux(&squares, &columns[cell]);
            println!("{} from ({x}, {y}): {found:.4}, expected {expected:.4}", kind.name);
            assert!((found / expected - 1.0).abs() < 0.05, "{} {x} {y}: {found} {expected}", kind.name);
        }
    }
}
