//! The flat patch of a scene on which strokes are played.
//!
//! A graph without a scene has a floor at height 0, and takes strokes as they are. In a scene strokes lie in
//! the middle of the first flat surface with a stiffness and a texture.

use std::sync::Arc;

use asperity_diagnostics::Diagnostic;
use asperity_graph::GraphFile;
use asperity_node::{ParamKind, Registry};
use asperity_scene::space::{Form, Surface};
use asperity_scene::{Scene, Touchable};

use crate::chain::Path3;
use crate::file::Tradeoff;
use crate::setting::LoadedGraph;
use crate::stroke::Stroke;

/// Margin along the edges of a surface \[mm\].
const MARGIN_MM: f64 = 1.0;
/// Smallest side of a patch \[mm\].
const LEAST_MM: f64 = 5.0;
/// Largest penetration of the stylus \[mm\]: down to it no other surface may lie in the patch.
const DEEP_MM: f64 = 4.0;
/// Radius of circular paths \[mm\], where there is room.
const RADIUS_MM: f64 = 20.0;
/// Speed during timing \[mm/s\].
const ROUND_MM_S: f64 = 80.0;
/// Rate at which a stroke is sampled to find its extent \[Hz\].
const LOOKED_HZ: f64 = 200.0;

/// A flat patch of a surface, around its middle.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    name: String,
    surface: Surface,
    /// Height of the face in the surface's coordinates \[mm\].
    height_mm: f64,
    /// Sides without the margin \[mm\]; none for an infinite plane.
    pub room_mm: Option<[f64; 2]>,
    /// Compliance, relative to a floor of 0.5 N/mm.
    compliance: f64,
}

impl Patch {
    /// The patch in the scene that a graph reads; none where it reads no scene.
    pub(crate) fn of(graph: &GraphFile, registry: &Registry) -> Result<Option<Self>, Diagnostic> {
        let reads = |kind: &str| {
            matches!(crate::knob::has(registry, kind, "scene"), Some(ParamKind::File))
                && crate::knob::has(registry, kind, "slots").is_some()
        };
        let Some(contact) = graph.nodes.iter().find(|n| reads(&n.kind)) else { return Ok(None) };
        let Some(setting) = contact.params.iter().find(|p| p.name == "scene") else { return Ok(None) };
        let scene = Scene::read(setting.value.path()?)?;
        let found = scene.surfaces.iter().find_map(|s| Self::on(s, &scene));
        found.map(Some).ok_or_else(|| {
            Diagnostic::new(format!(
                "no surface of this scene has room for a stroke. It needs a stiffness, a texture, and a \
                 flat face of {LEAST_MM} mm that no other surface covers"
            ))
            .in_file(scene.source.path())
            .help("use a graph, or a scene with a plane, rectangle or box that has a texture")
        })
    }

    fn on(touchable: &Touchable, scene: &Scene) -> Option<Self> {
        let stiffness = touchable.effects.stiffness.as_ref().filter(|s| s.of > 0.0)?.of;
        if !touchable.effects.has_texture() {
            return None;
        }
        let surface = touchable.surface.clone();
        let (height_mm, sides) = match surface.shape.form() {
            Form::Plane => (0.0, None),
            Form::Rectangle { size_mm, .. } => (0.0, Some(*size_mm)),
            Form::Box { size_mm: [x, y, z] } => (0.5 * z, Some([*x, *y])),
            // The physics is simulated over a flat floor: over hills force and speed differ.
            Form::Relief(_) | Form::Sphere { .. } => return None,
        };
        let room_mm = sides.map(|s| s.map(|side| side - 2.0 * MARGIN_MM));
        if room_mm.is_some_and(|[x, y]| x.min(y) < LEAST_MM) {
            return None;
        }
        let name = touchable.name.clone();
        let it = Self { name, surface, height_mm, room_mm, compliance: 0.5 / stiffness };
        // Of overlapping surfaces the one with the deepest penetration is touched.
        let [x, y] = room_mm.unwrap_or([2.0 * RADIUS_MM; 2]).map(|side| 0.5 * side);
        let own = |at: [f64; 3]| {
            let at = it.place(at);
            let depth = it.surface.depth_mm(at);
            let walls = scene.surfaces.iter().filter(|s| s.effects.stiffness.is_some());
            walls.filter(|s| s.name != it.name).all(|s| s.surface.depth_mm(at) < depth)
        };
        let spread =
            |part: f64| [part * x, 0.0, -part * x].map(|x| [part * y, 0.0, -part * y].map(|y| [x, y]));
        let free = [0.5, 1.0].iter().flat_map(|part| spread(*part).into_iter().flatten());
        free.into_iter().all(|[x, y]| own([x, y, -0.1]) && own([x, y, -DEEP_MM])).then_some(it)
    }

    /// Maps a point over a floor of 0.5 N/mm at height 0 onto the patch, with the same normal force.
    fn place(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let z = if z < 0.0 { z * self.compliance } else { z };
        self.surface.pose.to_world([x, y, z + self.height_mm])
    }

    /// Maps a path over that floor onto the patch; its centre becomes the middle.
    fn path(&self, path: Path3, [x, y]: [f64; 2]) -> Path3 {
        let it = self.clone();
        Arc::new(move |t| {
            let at = path(t);
            it.place([at[0] - x, at[1] - y, at[2]])
        })
    }

    /// Radius of circular paths \[mm\].
    fn radius_mm(&self) -> f64 {
        self.room_mm.map_or(RADIUS_MM, |[x, y]| RADIUS_MM.min(0.5 * x.min(y)))
    }
}

/// A stroke on the patch; unchanged without one.
pub(crate) fn place_stroke(patch: Option<&Patch>, stroke: &Stroke) -> Path3 {
    let Some(patch) = patch else { return stroke.measured.clone() };
    patch.path(stroke.measured.clone(), bounds(stroke).map(|[low, high]| 0.5 * (low + high)))
}

/// A path along x over the floor. On a patch it becomes a circle, at the same speed.
pub(crate) fn along(patch: Option<&Patch>, path: Path3) -> Path3 {
    let Some(patch) = patch else { return path };
    patch.path(round(path, patch.radius_mm()), [0.0; 2])
}

/// A circle at 80 mm/s and 1 N, which never stops: no node sleeps.
pub(crate) fn circle(graph: &GraphFile, registry: &Registry) -> Result<Path3, Diagnostic> {
    let patch = Patch::of(graph, registry)?;
    let radius = patch.as_ref().map_or(RADIUS_MM, Patch::radius_mm);
    let path = round(Arc::new(|t| [t * ROUND_MM_S, 0.0, -2.0]), radius);
    Ok(patch.map_or(path.clone(), |patch| patch.path(path, [0.0; 2])))
}

/// A path along x, bent to a circle.
fn round(path: Path3, radius: f64) -> Path3 {
    Arc::new(move |t| {
        let [x, _, z] = path(t);
        let (sin, cos) = (x / radius).sin_cos();
        [radius * cos, radius * sin, z]
    })
}

/// Range of a stroke in contact, along x and y \[mm\].
fn bounds(stroke: &Stroke) -> [[f64; 2]; 2] {
    let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for n in 0..=(stroke.seconds * LOOKED_HZ) as u64 {
        let at = (stroke.measured)(n as f64 / LOOKED_HZ);
        if at[2] < 0.0 {
            for (range, x) in bounds.iter_mut().zip(at) {
                *range = [range[0].min(x), range[1].max(x)];
            }
        }
    }
    bounds.map(|range| if range[0] <= range[1] { range } else { [0.0; 2] })
}

/// Opens the strokes. Synthetic ones are shrunk to fit on the patches of all graphs, with a note.
pub(crate) fn strokes<'b>(
    tradeoff: &Tradeoff,
    graphs: impl Iterator<Item = &'b LoadedGraph>,
    notes: &mut Vec<String>,
) -> Result<Vec<Stroke>, Diagnostic> {
    let patches = graphs.map(|base| Patch::of(&base.graph, &base.registry));
    let patches: Vec<Option<Patch>> = patches.collect::<Result<_, _>>()?;
    let mut strokes = Vec::new();
    for decl in &tradeoff.strokes {
        let mut stroke = decl.open()?;
        for patch in patches.iter().flatten() {
            let Some(room @ [x, y]) = patch.room_mm else { continue };
            let size = bounds(&stroke).map(|[low, high]| high - low);
            if size[0] <= room[0] && size[1] <= room[1] {
                continue;
            }
            let (name, surface) = (&stroke.name, &patch.name);
            let Some(smaller) = decl.shrunk(x.min(y)) else {
                let message = format!(
                    "`{name}` is {:.0} by {:.0} mm, and `{surface}` has room for {x:.0} by {y:.0}",
                    size[0], size[1]
                );
                let help = "a stroke of a `shape` is shrunk to fit";
                return Err(Diagnostic::new(message).at_place(&decl.place).help(help));
            };
            let (smaller, large) = smaller?;
            notes.push(format!("`{name}` is shrunk to {large:.0} mm: `{surface}` has no room for more"));
            stroke = smaller;
        }
        strokes.push(stroke);
    }
    Ok(strokes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{graph_of, loaded, tradeoff};

    /// A graph that reads a scene with these surfaces, in a folder.
    fn graph(dir: &std::path::Path, surfaces: &str) -> GraphFile {
        let scene = format!(
            r#"Scene(version: 1, input: trajectory(file: "t.csv"), output: probe(),
                surfaces: {{{surfaces}}})"#
        );
        std::fs::write(dir.join("scene.ron"), scene).unwrap();
        let nodes = r#""c": (kind: "contact", params: (scene: "scene.ron"))"#;
        graph_of(&dir.join("g.ron").display().to_string(), nodes, "")
    }

    fn patch(dir: &std::path::Path, surfaces: &str) -> Result<Patch, Diagnostic> {
        Patch::of(&graph(dir, surfaces), &asperity_nodes::registry()).map(Option::unwrap)
    }

    const TEXTURE: &str =
        r#"stiffness: (stiffness_n_per_mm: 2.0), texture: relief(heights: made(surface: "canvas"))"#;

    fn rectangle(place: &str) -> String {
        format!(r#"(shape: rectangle(size_mm: (20, 30)), place_mm: {place}, effects: ({TEXTURE}))"#)
    }

    #[test]
    fn strokes_lie_in_the_middle_of_the_first_textured_face() {
        let dir = tempfile::tempdir().unwrap();
        let dumb =
            r#"(shape: rectangle(size_mm: (20, 30)), effects: (stiffness: (stiffness_n_per_mm: 2.0)))"#;
        let surfaces = format!(r#""dumb": {dumb}, "right": {}"#, rectangle("(40, 5, 7)"));
        let patch = patch(dir.path(), &surfaces).unwrap();
        assert_eq!((patch.name.as_str(), patch.room_mm), ("right", Some([18.0, 28.0])));
        // The same force: 1 mm at 0.5 N/mm is a quarter of a mm at 2 N/mm. Above the surface nothing changes.
        assert_eq!(patch.place([1.0, 2.0, -1.0]), [41.0, 7.0, 6.75]);
        assert_eq!(patch.place([0.0, 0.0, 3.0]), [40.0, 5.0, 10.0]);
        // A line becomes a circle at the same speed.
        let path = along(Some(&patch), Arc::new(|t| [100.0 * t, 0.0, -1.0]));
        let (mut longest, mut gone) = (0.0_f64, 0.0);
        for n in 0..1000 {
            let [a, b] = [n, n + 1].map(|n| path(f64::from(n) * 1e-3));
            longest = longest.max((a[0] - 40.0).abs()).max((a[1] - 5.0).abs());
            gone += (b[0] - a[0]).hypot(b[1] - a[1]);
        }
        assert!((gone - 100.0).abs() < 0.01 && longest <= 9.0 + 1e-9, "{gone} {longest}");
        let graph = graph(dir.path(), &surfaces);
        let at = circle(&graph, &asperity_nodes::registry()).unwrap()(0.0);
        assert_eq!(at, [49.0, 5.0, 6.5]);
    }

    #[test]
    fn covered_curved_and_rough_surfaces_have_no_patch() {
        let dir = tempfile::tempdir().unwrap();
        let ball = format!(r#""ball": (shape: sphere(radius_mm: 30), effects: ({TEXTURE}))"#);
        let shape = r#"relief(heights: made(surface: "rubber pebble mat", side: 256, step_mm: 0.08),
            scale: 10.0, size_mm: (20, 20))"#;
        let hills = format!(r#""hills": (shape: {shape}, effects: ({TEXTURE}))"#);
        for (surfaces, found) in [
            (format!(r#""a": {}, "b": {}"#, rectangle("(0, 0, 0)"), rectangle("(5, 0, 1)")), Ok("b")),
            (format!(r#"{hills}, "flat": {}"#, rectangle("(100, 0, 0)")), Ok("flat")),
            (ball, Err("room for a stroke")),
            (hills, Err("room for a stroke")),
        ] {
            match (patch(dir.path(), &surfaces), found) {
                (Ok(patch), Ok(name)) => assert_eq!(patch.name, name),
                (Err(e), Err(why)) => assert!(e.to_string().contains(why), "{e}"),
                (other, _) => panic!("{found:?}: {other:?}"),
            }
        }
        // The hills are high.
        let scene = Scene::read(dir.path().join("scene.ron")).unwrap();
        let Form::Relief(relief) = scene.surfaces[0].surface.shape.form() else { panic!("no relief") };
        assert!(relief.bounds_mm[1] - relief.bounds_mm[0] > 3.0, "{:?}", relief.bounds_mm);
    }

    #[test]
    fn strokes_shrink_to_the_patch_and_files_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let base = loaded("s", graph(dir.path(), &format!(r#""a": {}"#, rectangle("(0, 0, 0)"))));
        let path = dir.path().join("s.ron").display().to_string();
        let of = |strokes: &str| tradeoff(&path, &format!("strokes: [{strokes}]"));
        let mut notes = Vec::new();
        let made = of(r#"(name: "z", shape: zigzag, extent_mm: 60.0), (name: "c", extent_mm: 10.0)"#);
        let strokes = strokes(&made, std::iter::once(&base), &mut notes).unwrap();
        assert!(notes.len() == 1 && notes[0].contains("`z`") && notes[0].contains("`a`"), "{notes:?}");
        let patch = Patch::of(&base.graph, &base.registry).unwrap();
        for stroke in &strokes {
            let path = place_stroke(patch.as_ref(), stroke);
            for n in 0..1000 {
                let [x, y, _] = path(f64::from(n) * 0.005);
                assert!(x.abs() <= 10.0 && y.abs() <= 15.0, "{} {x} {y}", stroke.name);
            }
        }
        let long = "t_s,x_mm,y_mm,z_mm\n0,0,0,-1\n1,100,0,-1\n2,0,0,-1\n";
        std::fs::write(dir.path().join("long.csv"), long).unwrap();
        let file = of(r#"(name: "mine", file: "long.csv")"#);
        let e = super::strokes(&file, std::iter::once(&base), &mut notes).unwrap_err().to_string();
        assert!(e.contains("`mine` is 100 by 0 mm") && e.contains("s.ron:1:"), "{e}");
    }
}
