//! The committed header is the one that is generated from this crate.

use std::path::Path;

#[test]
fn committed_header_is_current() {
    let dir = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(dir.join("cbindgen.toml")).unwrap();
    let bindings = cbindgen::Builder::new().with_crate(dir).with_config(config).generate().unwrap();
    let mut text = Vec::new();
    bindings.write(&mut text);
    // Links are for readers of the Rust documentation.
    let generated = String::from_utf8(text).unwrap().replace("[`", "`").replace("`]", "`");
    // Texts are the one thing that does not come over by itself.
    for text in [crate::ASPERITY_EXTENSION_RANDOM, crate::ASPERITY_EXTENSION_FACTS] {
        assert!(generated.contains(&format!("{text:?}")), "{text} is not in cbindgen.toml");
    }
    assert!(generated.contains(crate::ASPERITY_ENTRY_SYMBOL));
    let path = dir.join("include/asperity_plugin.h");
    if std::env::var_os("ASPERITY_WRITE_HEADER").is_some() {
        std::fs::write(&path, &generated).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(committed == generated, "{} is stale; write it anew with: make header", path.display());
}
