//! Contacts as a tick thread finds them.

use std::sync::Arc;

use asperity_scene::space::{Entry, HeightGrid, Hold, Index, Pose, Shape, Surface};
use harness::counting::allocations;

#[test]
fn contacts_are_found_without_allocating() {
    let heights = (0..64).map(|i| 0.1 * (i % 7) as f32).collect();
    let grid = Arc::new(HeightGrid::new(8, heights, [0.5; 2], true).unwrap());
    let entries: Vec<Entry> = (0..600_u32)
        .map(|i| {
            let shape = match i % 5 {
                0 => Shape::rectangle([4.0, 3.0], 1.0).unwrap(),
                1 => Shape::sphere(1.5).unwrap(),
                2 => Shape::cuboid([2.0, 3.0, 1.0]).unwrap(),
                3 => Shape::relief(grid.clone(), Some([3.0, 4.0]), 1.0, 1.0).unwrap(),
                _ => Shape::plane(),
            };
            let [x, y] = [f64::from(i % 30) - 15.0, f64::from(i / 30) - 10.0];
            let z = if i % 5 == 4 { -4.0 - 0.01 * f64::from(i) } else { 0.3 * (x - y).sin() };
            let pose = Pose::new([x, y, z], [f64::from(i % 4), f64::from(i % 9), f64::from(i)]).unwrap();
            Entry { surface: Surface { shape, pose }, reach_mm: f64::from(i % 3) }
        })
        .collect();
    let index = Index::new(entries, 0.1).unwrap();
    let (mut touched, mut near): (Option<Hold>, Option<Hold>) = (None, None);
    let mut changes = 0;
    let ((), count) = allocations(|| {
        for tick in 0..5000_u32 {
            let t = 0.01 * f64::from(tick);
            let x = if tick % 500 == 7 { f64::NAN } else { 12.0 * t.sin() };
            let point = [x, 8.0 * (1.3 * t).cos(), 3.0 * (2.9 * t).sin()];
            let found = index.deepest(point, touched).map(|c| c.hold());
            changes += usize::from(found != touched);
            touched = found;
            near = index.nearest(point, near).map(|c| c.hold());
        }
    });
    assert_eq!(count, 0);
    assert!(changes > 100 && near.is_some(), "{changes}");
}
