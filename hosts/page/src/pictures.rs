//! The materials of the running graph for a gallery, and their pictures.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;
use std::sync::Arc;

use asperity_live::view::Material;
use axum::extract::{Path as At, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;

use crate::server::Shared;

/// Largest picture in bytes.
const LARGEST: u64 = 4 * 1024 * 1024;

/// First bytes of the kinds of pictures that a library may name.
const KINDS: [(&[u8], &str); 3] =
    [(b"\x89PNG\r\n\x1a\n", "image/png"), (b"\xff\xd8\xff", "image/jpeg"), (b"BM", "image/bmp")];

/// The materials of each texture node, in JSON.
pub(crate) async fn materials(State(shared): State<Arc<Shared>>) -> Response {
    #[derive(Serialize)]
    struct Shown<'a> {
        #[serde(flatten)]
        material: &'a Material,
        pictured: bool,
    }
    let layout = shared.feed.layout();
    let shown = |material| Shown { material, pictured: material.picture.is_some() };
    let of = layout.materials.iter().map(|m| (&m.node, m.gallery.iter().map(shown).collect::<Vec<_>>()));
    let all: std::collections::BTreeMap<_, _> = of.collect();
    let text = serde_json::to_string(&all).unwrap_or_default();
    ([(header::CONTENT_TYPE, "application/json")], text).into_response()
}

/// The picture of a node's material: only a file that the library of the running graph names.
pub(crate) async fn picture(
    State(shared): State<Arc<Shared>>,
    At((node, name)): At<(String, String)>,
) -> Response {
    let layout = shared.feed.layout();
    let of_node = layout.materials.iter().filter(|m| m.node == node).flat_map(|m| &m.gallery);
    let path = of_node.filter(|m| m.name == name).find_map(|m| m.picture.as_deref());
    match path.and_then(|path| read(path).ok()) {
        Some((kind, bytes)) => ([(header::CONTENT_TYPE, kind)], bytes).into_response(),
        None => (StatusCode::NOT_FOUND, "no such picture\n").into_response(),
    }
}

/// Reads a picture and tells its kind. Another file is refused, whatever its name.
fn read(path: &Path) -> io::Result<(&'static str, Vec<u8>)> {
    let refused = || io::Error::from(io::ErrorKind::InvalidData);
    // To open a pipe would wait for its writer.
    if !std::fs::metadata(path)?.is_file() {
        return Err(refused());
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(LARGEST + 1).read_to_end(&mut bytes)?;
    let kind = KINDS.iter().find(|(first, _)| bytes.starts_with(first)).map(|(_, kind)| *kind);
    let fits = bytes.len() as u64 <= LARGEST;
    kind.filter(|_| fits).map(|kind| (kind, bytes)).ok_or_else(refused)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pictures_of_bounded_size_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let read = |bytes: &[u8]| {
            let file = dir.path().join("x.png");
            std::fs::write(&file, bytes).unwrap();
            super::read(&file).ok().map(|(kind, bytes)| (kind, bytes.len()))
        };
        assert_eq!(read(b"\xff\xd8\xff\xe0"), Some(("image/jpeg", 4)));
        assert_eq!(read(b"root:x:0:0"), None);
        let mut long = b"BM".to_vec();
        long.resize(LARGEST as usize, 0);
        assert_eq!(read(&long), Some(("image/bmp", long.len())));
        long.push(0);
        assert_eq!(read(&long), None);
        assert!(super::read(dir.path()).is_err());
    }
}
