//! Tests of the reader and of what it refuses.

use super::*;
use crate::Diagnostic;

fn read(text: &str) -> Result<Value, Diagnostic> {
    parse(&Source::new("t.ron", text))
}

fn error(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

#[test]
fn every_kind_of_value_is_read_with_its_position() {
    let v =
        read("// c\nGraph(\n  a: 1, /* x */ b: -2.5e1,\n  c: [true, \"t\\n\"], d: {\"k\": (1, 2)}, e: zig,)")
            .unwrap();
    let mut r = v.record("Graph").unwrap();
    assert_eq!(r.required("a").unwrap().i64().unwrap(), 1);
    let b = r.required("b").unwrap();
    assert_eq!(b.f64().unwrap(), -25.0);
    assert_eq!(b.source().position(b.span().start).column, 20);
    let c = r.required("c").unwrap().list().unwrap();
    assert!(c[0].bool().unwrap());
    assert_eq!(c[1].text().unwrap(), "t\n");
    let d = r.required("d").unwrap().map().unwrap();
    assert_eq!((d[0].0.name.as_str(), d[0].1.list().unwrap().len()), ("k", 2));
    assert_eq!(r.required("e").unwrap().choice(&["zig", "zag"]).unwrap(), "zig");
    r.finish().unwrap();
}

#[test]
fn duplicate_key_is_refused_at_the_second() {
    assert!(error("{\"a\": 1,\n \"a\": 2}").starts_with("t.ron:2:2: `a` is given twice"));
    assert!(error("(x: 1,\n x: 2)").starts_with("t.ron:2:2: `x` is given twice"));
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    for bad in ["NaN", "inf", "-inf", "1e400", "+NaN"] {
        let e = error(&format!("(x: {bad})"));
        assert!(e.starts_with("t.ron:1:5: not a finite number"), "{bad}: {e}");
    }
}

#[test]
fn syntax_errors_say_where() {
    assert!(error("(a: 1,\n b 2)").starts_with("t.ron:2:3:"));
    assert!(error("").starts_with("t.ron:1:1:"));
    assert!(error("(a: \"open").contains("t.ron:1:"));
    assert!(error("#![enable(implicit_some)]\n(a: 1)").contains("extensions"));
    assert!(
        error("// c\n/* a /* b */ */ #![enable(implicit_some)]\n(a: 1)")
            .starts_with("t.ron:2:17: RON extensions")
    );
    assert!(error(&"[".repeat(10_000)).contains("nested too deeply"));
}

#[test]
fn unknown_field_names_its_neighbour() {
    let v = read("(cutof_hz: 20)").unwrap();
    let mut r = v.record("P").unwrap();
    assert!(r.optional("cutoff_hz").is_none());
    let e = r.finish().unwrap_err().to_string();
    assert_eq!(e, "t.ron:1:2: unknown field `cutof_hz` (did you mean `cutoff_hz`?)");
}

#[test]
fn out_of_range_says_the_range_and_the_unit() {
    let e = read("(x: 900)").unwrap();
    let e = e.record("P").unwrap().required("x").unwrap().f64_in(0.0..=250.0, "Hz").unwrap_err();
    assert_eq!(e.to_string(), "t.ron:1:5: 900 Hz is out of range (from 0 to 250 Hz)");
}

#[test]
fn command_line_value_may_be_bare_text() {
    let get = |t: &str| parse_or_text(&Source::new("--set", t)).unwrap().kind().clone();
    assert_eq!(get("20.5"), Kind::Float(20.5));
    assert_eq!(get("coarse weave"), Kind::Text("coarse weave".into()));
    assert_eq!(get("zigzag"), Kind::Text("zigzag".into()));
    assert_eq!(get("true"), Kind::Bool(true));
}

#[test]
fn no_prefix_of_a_good_text_panics() {
    let good =
        "G(a: [1, -2.0, \"x\"], m: {\"k\": (1, b: 2)}, r: r#\"raw\"#, c: 'c', s: Some(3), é: 1) // end";
    for i in (0..=good.len()).filter(|&i| good.is_char_boundary(i)) {
        let _ = read(&good[..i]);
        let _ = read(&good[i..]);
    }
}

#[test]
fn name_with_empty_parentheses_has_no_fields() {
    let v = read("(a: audio_out(), b: audio_out( /* none */ ), c: audio_out)").unwrap();
    let mut r = v.record("Graph").unwrap();
    for name in ["a", "b"] {
        let field = r.required(name).unwrap();
        let Kind::Record { name: Some(n), fields } = field.kind() else { panic!("{field:?}") };
        assert!(n == "audio_out" && fields.is_empty());
        assert!(field.record("audio_out").unwrap().finish().is_ok());
    }
    assert!(matches!(r.required("c").unwrap().kind(), Kind::Word(w) if w == "audio_out"));
}

#[test]
fn unnamed_fields_in_a_named_record_are_refused() {
    let said = error("(a: dahl(0.3))");
    assert!(said.contains("the fields of `dahl(...)` need names"), "{said}");
}
