//! A run of packed kernels allocates nothing.

use asperity_texture::{Answer, Choice, Model, Precision};
use harness::counting::allocations;
use harness::networks::{Net, Spelling, bytes, heads, motions, scattering, textures};

#[test]
fn packed_runs_allocate_nothing_unlike_tract() {
    let made = scattering(&Net::random(1), Spelling::default(), &heads(1));
    asperity_texture::run_graphs_by(asperity_tract::compile);
    let model = Model::from_bytes(&bytes(&made), "made.onnx").unwrap();
    let textures = textures(3, 1);
    let motions = motions(50, 2);
    let (mut out, mut answer) = ([0.0; 100], Answer::default());
    for precision in Precision::ALL {
        let packed = precision.isas().into_iter().map(Choice::Packed);
        for choice in packed.chain((precision == Precision::F64).then_some(Choice::Auto)) {
            let mut runner = model.runner(&textures, precision, choice).unwrap();
            assert!(runner.is_allocation_free());
            let ((), count) = allocations(|| {
                for (i, (force, speed)) in motions.iter().enumerate() {
                    let _ = runner.run(i % 3, force, speed, &mut out);
                    let _ = runner.answer(i % 3, force, speed, &mut answer);
                    let _ = runner.run(3, force, speed, &mut out);
                    let _ = runner.run(0, &force[1..], speed, &mut out);
                }
                let _ = runner.read_weights();
            });
            assert_eq!(count, 0, "{choice:?} {precision:?}");
            assert!(out.iter().any(|&x| x > 0.0));
        }
    }
    let mut tract = model.runner(&textures, Precision::F32, Choice::Tract).unwrap();
    assert!(!tract.is_allocation_free());
    let (force, speed) = &motions[2];
    tract.run(0, force, speed, &mut out).unwrap();
    let ((), count) = allocations(|| {
        let _ = tract.run(0, force, speed, &mut out);
    });
    assert!(count > 10, "the allocator must be watching; it saw {count}");
}
