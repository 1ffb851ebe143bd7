//! Files that are no model, models of another signature, and numbers that are none.

use super::networks::{
    Net, Random, Spelling, bytes, heads, int, int_tensor, node, scattering, tensor, textures, value_info,
};
use super::{SHIPPED, load, made, run};
use crate::onnx::{AttributeProto, GraphProto, TensorProto};
use crate::{Choice, Isa, Model, Precision, RunError, Runner};
use prost::Message;
use std::sync::Arc;

/// The error of a made model after `change`.
fn error(change: impl FnOnce(&mut GraphProto)) -> String {
    let mut m = made(1);
    change(m.graph.as_mut().unwrap());
    let e = load(&m).unwrap_err();
    assert_eq!(e.path().unwrap(), std::path::Path::new("some/where.onnx"));
    e.to_string()
}

#[test]
fn a_file_cut_short_anywhere_is_an_error() {
    let whole = bytes(&made(1));
    for part in 0..20 {
        let cut = &whole[..whole.len() * part / 20];
        let e = Model::from_bytes(cut, "cut.onnx").unwrap_err().to_string();
        assert!(e.starts_with("cut.onnx: "), "{e}");
    }
    Model::from_bytes(&whole, "whole.onnx").unwrap();
}

#[test]
fn files_that_are_no_model_are_errors() {
    let dir = tempfile::tempdir().unwrap();
    let mut r = Random(3);
    let noise: Vec<u8> = (0..100_000).map(|_| (r.unit() * 256.0) as u8).collect();
    let json = br#"{"force": [1, 10], "speed": [1, 20], "texture": [1, 256]}"#.to_vec();
    for (name, content) in [("noise.onnx", noise), ("model.json", json), ("empty.onnx", vec![])] {
        let path = dir.path().join(name);
        std::fs::write(&path, content).unwrap();
        let e = Model::load(&path).unwrap_err();
        assert_eq!(e.path().unwrap(), path);
        assert!(e.help.is_some(), "{e}");
    }
    assert!(Model::load(dir.path()).unwrap_err().to_string().contains("this is a folder"));
    assert!(Model::load(dir.path().join("none.onnx")).unwrap_err().to_string().contains("cannot read"));
    let large = dir.path().join("large.onnx");
    std::fs::File::create(&large).unwrap().set_len(crate::MAX_MODEL_BYTES + 1).unwrap();
    assert!(Model::load(&large).unwrap_err().to_string().contains("at most"));
}

#[test]
fn flipped_bytes_never_panic_out_of_load() {
    let whole = bytes(&made(1));
    let mut r = Random(4);
    // The first kilobytes hold the nodes; weights take almost all of the rest.
    for round in 0..30 {
        let mut bent = whole.clone();
        for _ in 0..1 + round % 4 {
            let reach = if round % 2 == 0 { 3000 } else { bent.len() };
            let at = (r.unit() * reach as f64) as usize;
            bent[at] = (r.unit() * 256.0) as u8;
        }
        if let Ok(model) = Model::from_bytes(&bent, "bent.onnx") {
            let _ = model.runner(&textures(1, 1), Precision::F16, Choice::Auto);
        }
    }
}

#[test]
fn wrong_signature_tells_what_was_found_and_what_would_fit() {
    type Change = fn(&mut GraphProto);
    let cases: [(Change, &[&str]); 7] = [
        (
            |g| g.input[0] = value_info("force", &[Some(1), Some(12)]),
            &["force [1,12]", "texture [1,256]", "magnitudes [1,100]"],
        ),
        (|g| g.input[2] = value_info("texture", &[Some(1), Some(1 << 40)]), &["texture [1,1099511627776]"]),
        (|g| g.input[1] = value_info("speed", &[Some(2), Some(20)]), &["speed [2,20]"]),
        (|g| drop(g.input.remove(1)), &["2 inputs", "speed [1,20]"]),
        (|g| g.input.push(value_info("image", &[Some(1), Some(3)])), &["4 inputs", "image [1,3]"]),
        (|g| g.output[0] = value_info("magnitudes", &[Some(1), Some(101)]), &["magnitudes [1,101]"]),
        (
            |g| g.input[0].r#type.as_mut().unwrap().tensor_type.as_mut().unwrap().elem_type = 11,
            &["not 32-bit float"],
        ),
    ];
    for (change, texts) in cases {
        let e = error(change);
        assert!(texts.iter().all(|text| e.contains(text)), "{e}");
    }
}

#[test]
fn an_output_of_another_shape_than_stated_is_an_error() {
    let e = error(|g| {
        let last = g.node.last_mut().unwrap();
        let input = last.input[0].clone();
        *last = node("Concat", &[&input, &input], "magnitudes", vec![int("axis", 1)]);
    });
    assert!(e.contains("some/where.onnx: "), "{e}");
}

/// The error of a made model with scatter after `change`.
fn scatter_error(swapped: bool, change: impl FnOnce(&mut GraphProto)) -> String {
    let mut heads = heads(1);
    if swapped {
        (heads[0].0, heads[1].0) = ("variance", "ratio");
    }
    let mut m = scattering(&Net::random(1), Spelling::default(), &heads);
    assert!(swapped || load(&m).is_ok());
    change(m.graph.as_mut().unwrap());
    load(&m).unwrap_err().to_string()
}

#[test]
fn scatter_of_another_shape_is_refused() {
    let wanted = "ratio [1,100] and variance [1,1]";
    let output = |g: &mut GraphProto, name: &str, len| {
        *g.output.iter_mut().find(|v| v.name == name).unwrap() = value_info(name, &[Some(1), len]);
    };
    let e = scatter_error(false, |g| output(g, "ratio", Some(99)));
    assert!(e.contains("output ratio [1,99] does not fit [1,100]") && e.contains(wanted), "{e}");
    let e = scatter_error(false, |g| output(g, "variance", Some(100)));
    assert!(e.contains("output variance [1,100] does not fit [1,1]") && e.contains(wanted), "{e}");
    // Shapes that only the graph tells.
    let e = scatter_error(true, |g| ["ratio", "variance"].iter().for_each(|name| output(g, name, None)));
    assert!(e.contains("output ratio has shape") && e.contains("not [1,100] float"), "{e}");
}

#[test]
fn ratio_without_variance_is_refused() {
    for (name, missing) in [("ratio", "variance"), ("variance", "ratio")] {
        let e = scatter_error(false, |g| g.output.retain(|v| v.name != missing));
        let wanted = format!("this model has the output {name}, but not {missing}");
        assert!(e.contains(&wanted) && e.contains("Optional, together"), "{e}");
    }
}

#[test]
fn weights_that_lie_about_themselves_are_errors() {
    type Change = fn(&mut TensorProto);
    let cases: [(Change, &str); 5] = [
        (|t| t.dims = vec![1 << 40, 1 << 40], "shape"),
        (|t| t.dims = vec![-1, 10], "shape"),
        (|t| t.raw_data.truncate(13), "elements"),
        (|t| t.data_type = 99, "element type"),
        (|t| (t.raw_data, t.data_location) = (Vec::new(), Some(1)), "in another file"),
    ];
    for (change, text) in cases {
        let e = error(|g| change(g.initializer.iter_mut().find(|t| t.dims.len() == 2).unwrap()));
        assert!(e.contains(text), "{text}: {e}");
    }
}

#[test]
fn unordered_or_oversized_graphs_are_errors() {
    let e = error(|g| g.node.reverse());
    assert!(e.contains("nothing before it gives"), "{e}");
    let e = error(|g| g.output[0].name = "elsewhere".into());
    assert!(e.contains("nothing gives the output"), "{e}");
    let e = error(|g| {
        g.initializer.push(int_tensor("huge", &[1 << 30, 1 << 30]));
        g.node.insert(0, node("ConstantOfShape", &["huge"], "filled", vec![]));
    });
    assert!(e.contains("ConstantOfShape") && e.contains("elements"), "{e}");
    let e = error(|g| {
        let branch =
            AttributeProto { name: "then_branch".into(), g: Some(g.encode_to_vec()), ..Default::default() };
        g.node[0].attribute.push(branch);
    });
    assert!(e.contains("holds a graph of its own"), "{e}");
}

/// A file of 2 kB that multiplies vectors along five axes took 14 GB.
#[test]
fn outer_products_are_refused_before_they_are_made() {
    let e = error(|g| {
        for axis in 0..5 {
            let mut dims = [1; 5];
            dims[axis] = 400;
            g.initializer.push(tensor(&format!("v{axis}"), &dims, &[1e-3; 400]));
        }
        for axis in (1..5).rev() {
            let before = if axis == 1 { "v0".into() } else { format!("p{}", axis - 1) };
            g.node.insert(0, node("Mul", &[&before, &format!("v{axis}")], &format!("p{axis}"), vec![]));
        }
    });
    assert!(e.contains("brings the tensors to") && e.contains("at most 33554432 are made"), "{e}");
}

/// Why a made model with these nodes before its own is not lowered.
fn not_lowered(change: impl FnOnce(&mut GraphProto)) -> String {
    let mut m = made(1);
    change(m.graph.as_mut().unwrap());
    load(&m).unwrap().not_lowered_because().unwrap().into()
}

/// A sum of two steps, 163840 wide, took 430 GB from a file of 2 kB.
#[test]
fn full_matrices_are_refused_before_they_are_made() {
    for mixed in [false, true] {
        let why = not_lowered(|g| {
            // 16384 or 20480 numbers.
            let mut nodes = Vec::new();
            let mut wide = String::from(if mixed { "texture" } else { "force" });
            for i in 0..if mixed { 6 } else { 11 } {
                let twice = format!("wide{i}");
                nodes.push(node("Concat", &[&wide, &wide], &twice, vec![int("axis", 1)]));
                wide = twice;
            }
            nodes.push(node("Relu", &[&wide], "once", vec![]));
            if mixed {
                // Constants beside force: their part becomes a bias, by way of a matrix.
                nodes.push(node("Concat", &["once", "force"], "sum", vec![int("axis", 1)]));
            } else {
                nodes.push(node("Relu", &[&wide], "again", vec![]));
                nodes.push(node("Add", &["once", "again"], "sum", vec![]));
            }
            nodes.push(node("Relu", &["sum"], "end", vec![]));
            g.node.splice(0..0, nodes);
        });
        assert!(why.contains("too large to lower"), "{why}");
    }
}

/// Products of constants are small, but take time.
#[test]
fn products_of_constants_count_towards_the_limit() {
    let why = not_lowered(|g| {
        g.initializer.push(tensor("row", &[30, 1000], &[1e-3; 30_000]));
        g.initializer.push(tensor("column", &[1000, 30], &[1e-3; 30_000]));
        let product = |i| node("MatMul", &["row", "column"], &format!("product{i}"), vec![]);
        g.node.splice(0..0, (0..12).map(product));
    });
    assert!(why.contains("MatMul") && why.contains("too large to lower"), "{why}");
}

fn runners() -> Vec<Runner> {
    let model = load(&made(1)).unwrap();
    let mut choices = vec![(Choice::Tract, Precision::F32)];
    for isa in Isa::available() {
        choices.extend([(Choice::Packed(isa), Precision::F32), (Choice::Packed(isa), Precision::F16)]);
    }
    choices.into_iter().map(|(c, p)| model.runner(&textures(2, 1), p, c).unwrap()).collect()
}

#[test]
fn a_runner_refuses_what_it_does_not_have() {
    for mut runner in runners() {
        let mut out = [7.0; 100];
        let good = ([0.0; 10], [0.0; 20]);
        for (material, force, speed, len, want) in [
            (2, &good.0[..], &good.1[..], 100, RunError::Material { index: 2, count: 2 }),
            (usize::MAX, &good.0, &good.1, 100, RunError::Material { index: usize::MAX, count: 2 }),
            (0, &good.0[..9], &good.1, 100, RunError::Length),
            (0, &good.0, &[0.0; 21], 100, RunError::Length),
            (0, &good.0, &good.1, 99, RunError::Length),
        ] {
            assert_eq!(runner.run(material, force, speed, &mut out[..len]), Err(want));
        }
        assert_eq!(out, [7.0; 100]);
    }
}

#[test]
fn packed_networks_pass_nan_on_and_recover_from_it() {
    for mut runner in runners() {
        let clean = run(&mut runner, 0, &[1.0; 10], &[50.0; 20]);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
            let mut force = [1.0; 10];
            force[3] = bad;
            let out = run(&mut runner, 0, &force, &[50.0; 20]);
            if bad.is_nan() && runner.is_allocation_free() {
                assert!(out.iter().all(|x| x.is_nan()), "{:?}", runner.describe().executor);
            }
            let after = run(&mut runner, 0, &[1.0; 10], &[50.0; 20]);
            assert_eq!(after, clean, "nothing of {bad} stays behind");
        }
    }
}

#[test]
fn materials_that_do_not_fit_are_named() {
    let model = load(&made(1)).unwrap();
    let refused = |materials: &[Vec<f32>]| {
        model.runner(materials, Precision::F32, Choice::Auto).unwrap_err().to_string()
    };
    assert!(refused(&[]).contains("0 materials"));
    assert!(
        refused(&[vec![0.0; 256], vec![0.0; 255]]).contains("material 1 has a texture vector of 255 numbers")
    );
    let mut bad = vec![0.0; 256];
    bad[7] = f32::NAN;
    assert!(refused(&[bad]).contains("number 7 of material 0"));
}

#[test]
fn changed_file_is_read_again() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.onnx");
    std::fs::copy(format!("{SHIPPED}texture.onnx"), &path).unwrap();
    let first = Model::shared(&path).unwrap();
    assert!(Arc::ptr_eq(&first, &Model::shared(&path).unwrap()));
    let runner = |materials: &[[f32; 256]], precision, choice| -> Runner {
        fn may_move_to_another_thread<T: Send>(of: T) -> T {
            of
        }
        may_move_to_another_thread(first.runner(materials, precision, choice).unwrap())
    };
    let all = [[0.1_f32; 256], [0.2; 256]];
    let answer = |runner: &mut Runner, material| run(runner, material, &[1.0; 10], &[50.0; 20]);
    let mut one = runner(&all, Precision::Int8, Choice::Auto);
    let before = answer(&mut one, 1);
    // A copy has its own state.
    let mut other = runner(&all, Precision::Int8, Choice::Auto);
    assert_eq!((answer(&mut other, 0), answer(&mut other, 1)), (answer(&mut one, 0), before));
    let mut single = runner(&all[1..], Precision::Int8, Choice::Auto);
    assert_ne!(answer(&mut single, 0), answer(&mut one, 0));
    let executor = |precision, choice| runner(&all, precision, choice).describe().executor;
    let single = executor(Precision::F32, Choice::Auto);
    assert_ne!(single, executor(Precision::F64, Choice::Auto));
    assert_ne!(single, executor(Precision::F32, Choice::Tract));
    assert_eq!(single, executor(Precision::F32, Choice::Auto));
    std::fs::copy(format!("{SHIPPED}texture_mean.onnx"), &path).unwrap();
    assert!(!Arc::ptr_eq(&first, &Model::shared(&path).unwrap()));
}
