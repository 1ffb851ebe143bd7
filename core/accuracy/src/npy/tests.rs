use super::*;
use proptest::prelude::*;
use std::io::Cursor;

/// Bytes of `np.save(f, np.array([[1.5, -2, 3e-8], [np.inf, 0, 7]], dtype=descr))` in NumPy 2.4.6.
fn numpy(descr: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let text = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(format!("{text:<117}\n").bytes());
    assert_eq!(bytes.len(), 128);
    bytes.extend(data);
    bytes
}

#[test]
fn files_of_both_precisions_and_byte_orders_are_read() {
    let x = [1.5, -2.0, 3e-8, f64::INFINITY, 0.0, 7.0];
    let wide: Vec<u8> = x.iter().flat_map(|v| v.to_le_bytes()).collect();
    let swapped: Vec<u8> = x.iter().flat_map(|v| (*v as f32).to_be_bytes()).collect();
    let a = parse(&numpy("<f8", "False", "(2, 3)", &wide)).unwrap();
    assert_eq!((a.shape, a.values), (vec![2, 3], Values::F64(x.to_vec())));
    let b = parse(&numpy(">f4", "False", "(6,)", &swapped)).unwrap();
    assert_eq!((b.shape, b.values.into_f32()), (vec![6], x.map(|v| v as f32).to_vec()));
    let c = parse(&numpy("<f8", "True", "(1, 6)", &wide)).unwrap();
    assert_eq!(c.values.into_f64(), x);
    let empty = parse(&numpy("<f4", "False", "(0, 101)", &[])).unwrap();
    assert!(empty.values.is_empty());
}

#[test]
fn file_by_numpy_is_read() {
    let a =
        read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/phase/sine_off_2500.mag.npy")).unwrap();
    // np.load(f)[0, 15], [451-1, 100]
    assert_eq!(a.shape, [451, 101]);
    let v = a.values.into_f32();
    assert_eq!((v[15], v[450 * 101 + 100]), (57.172745, 2.9686094e-05));
}

#[test]
fn unreadable_file_is_refused_with_a_remedy() {
    let numpy = |descr: &str, order: &str, shape: &str| numpy(descr, order, shape, &[0; 24]);
    for (bytes, wanted) in [
        (b"".to_vec(), "empty"),
        (b"PK\x03\x04....".to_vec(), "npz"),
        (b"RIFF....WAVE".to_vec(), "not a .npy"),
        (b"\x93NUMPY\x01".to_vec(), "within its header"),
        (b"\x93NUMPY\x09\x00\x10\x00".to_vec(), "version 9.0"),
        (b"\x93NUMPY\x02\x00\xff\xff\xff\xff".to_vec(), "4294967295 bytes"),
        (numpy("<i8", "False", "(3,)"), "\"<i8\""),
        (numpy("<i8", "False", "(3,)"), "astype(np.float32)"),
        (numpy("<c8", "False", "(3,)"), "\"<c8\""),
        (numpy("<f4", "True", "(2, 3)"), "ascontiguousarray"),
        (numpy("<f4", "False", "()"), "(frames, bins)"),
        (numpy("<f4", "False", "(1, 2, 3)"), "(1, 2, 3)"),
        (numpy("<f4", "False", "(2, 4)"), "24 bytes"),
        (numpy("<f4", "False", "(5,)"), "needs 20"),
        (numpy("<f4", "False", "(9223372036854775807, 9)"), "at most"),
        (numpy("<f4", "False", "(99999999999999999999999,)"), "the header"),
        (numpy("<f4", "Maybe", "(6,)"), "True or False"),
        (numpy("<f4", "False", "(-6,)"), "a length"),
        (numpy("<f4", "False", "6"), "a length"),
    ] {
        let found = parse(&bytes).expect_err(wanted).to_string();
        assert!(found.contains(wanted), "{wanted}: {found}");
    }
    let named = read("no/such.npy").unwrap_err().to_string();
    assert!(named.starts_with("no/such.npy: cannot read"), "{named}");
}

#[test]
fn arrays_are_written_as_by_numpy() {
    let x = [1.5f32, -2.0, 3e-8, f32::INFINITY, 0.0, 7.0];
    let bytes: Vec<u8> = x.iter().flat_map(|v| v.to_le_bytes()).collect();
    let mut out = Vec::new();
    write_f32(&mut out, &[2, 3], &x).unwrap();
    assert_eq!(out, numpy("<f4", "False", "(2, 3)", &bytes));
    assert!(write_f32(Vec::new(), &[2, 2], &x).is_err());
}

#[test]
fn rows_are_appended() {
    let mut w = Writer::new(Cursor::new(Vec::new()), Some(3)).unwrap();
    w.append(&[1.0, 2.0, 3.0]).unwrap();
    assert!(w.append(&[1.0]).is_err());
    w.append(&[4.0, 5.0, 6.0, 7.0, 8.0, 9.0]).unwrap();
    let a = parse(&w.finish().unwrap().into_inner()).unwrap();
    assert_eq!((a.shape, a.values), (vec![3, 3], Values::F32((1u8..=9).map(f32::from).collect())));
    let mut w = Writer::new(Cursor::new(Vec::new()), None).unwrap();
    w.append(&[0.5; 5000]).unwrap();
    let a = parse(&w.finish().unwrap().into_inner()).unwrap();
    assert_eq!((a.shape, a.values), (vec![5000], Values::F32(vec![0.5; 5000])));
}

proptest! {
    #[test]
    fn garbage_is_an_error(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        prop_assert!(parse(&bytes).is_err());
    }

    #[test]
    fn spoilt_header_is_an_error_or_has_its_shape(at in 0usize..128, byte in any::<u8>()) {
        let mut bytes = numpy("<f4", "False", "(2, 3)", &[0; 24]);
        bytes[at] = byte;
        if let Ok(a) = parse(&bytes) {
            prop_assert_eq!(a.shape.iter().product::<usize>(), a.values.into_f32().len());
        }
    }
}
