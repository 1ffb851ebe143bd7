//! Where on a scene's surfaces a stylus finds room.
//!
//! A graph that was made for a floor at height 0 takes strokes as they are. A scene has surfaces here and there, with gaps between them: there, strokes lie in
//! the middle of the first flat surface that sounds.

use std::sync::Arc;

use asperity_diagnostics::Diagnostic;
use asperity_graph::GraphFile;
use asperity_node::{ParamKind, Registry};
use asperity_scene::space::{Form, Surface};
use asperity_scene::{Scene, Touchable};

use crate::file::{Study, beside};
use crate::hear::Path3;
use crate::setting::Base;
use crate::stroke::Stroke;

/// What is left free along the edges of a surface \[mm\].
const MARGIN_MM: f64 = 1.0;
/// The least room for a stroke \[mm\].
const LEAST_MM: f64 = 5.0;
/// Where it is looked for what else lies there \[mm\]: so deep a stylus is at most.
const DEEP_MM: f64 = 4.0;
/// Radius of the ways that go round \[mm\], where there is room.
const RADIUS_MM: f64 = 20.0;
/// Speed at which times are taken \[mm/s\].
const ROUND_MM_S: f64 = 80.0;
/// Samples a second by which the extent of a stroke is found.
const LOOKED_HZ: f64 = 200.0;

/// The middle of a surface.
#[derive(Clone, Debug)]
pub(crate) struct Spot {
    /// The surface's name.
    name: String,
    surface: Surface,
    /// Height of its face in coordinates of its own \[mm\].
    height_mm: f64,
    /// Length of its sides, without the margin; none where it is endless \[mm\].
    pub room_mm: Option<[f64; 2]>,
    /// Depth for each mm of a floor of 0.5 N/mm.
    soft: f64,
}

impl Spot {
    /// The place on the surfaces of the scene that a graph reads; none where it reads none.
    ///
    /// # Errors
    /// A scene that cannot be read; no surface that sounds has 5 mm of a flat face that are its own.
    pub(crate) fn of(graph: &GraphFile, registry: &Registry) -> Result<Option<Self>, Diagnostic> {
        let reads = |kind: &str| {
            matches!(crate::knob::has(registry, kind, "scene"), Some(ParamKind::File))
                && crate::knob::has(registry, kind, "slots").is_some()
        };
        let Some(contact) = graph.nodes.iter().find(|n| reads(&n.kind)) else { return Ok(None) };
        let Some(setting) = contact.params.iter().find(|p| p.name == "scene") else { return Ok(None) };
        let scene = Scene::read(beside(&setting.value)?)?;
        let found = scene.surfaces.iter().find_map(|s| Self::on(s, &scene));
        found.map(Some).ok_or_else(|| {
            Diagnostic::new(format!(
                "no surface of this scene has room for a stroke: it needs a stiffness, a texture and {LEAST_MM} mm of a flat face (a plane, a rectangle, a box; no relief, no sphere) on which no other one lies"
            ))
            .in_file(scene.source.path())
            .help("study a graph, or a scene with a rectangle that has a texture")
        })
    }

    fn on(touchable: &Touchable, scene: &Scene) -> Option<Self> {
        let stiffness = touchable.effects.stiffness.as_ref().filter(|s| s.of > 0.0)?.of;
        if touchable.effects.textures.is_empty() {
            return None;
        }
        let surface = touchable.surface.clone();
        let (height_mm, sides) = match surface.shape.form() {
            Form::Plane => (0.0, None),
            Form::Rectangle { size_mm, .. } => (0.0, Some(*size_mm)),
            Form::Box { size_mm: [x, y, z] } => (0.5 * z, Some([*x, *y])),
            // Over hills a stylus is neither as hard pressed nor as fast as over the floor that the physics are of.
            Form::Relief(_) | Form::Sphere { .. } => return None,
        };
        let room_mm = sides.map(|s| s.map(|side| side - 2.0 * MARGIN_MM));
        if room_mm.is_some_and(|[x, y]| x.min(y) < LEAST_MM) {
            return None;
        }
        let name = touchable.name.clone();
        let it = Self { name, surface, height_mm, room_mm, soft: 0.5 / stiffness };
        // Of what overlaps the deepest is touched.
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

    /// Where a point over a floor at height 0 of 0.5 N/mm, its middle at x = y = 0, lies on the surface: as hard pressed.
    fn place(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let z = if z < 0.0 { z * self.soft } else { z };
        self.surface.pose.to_world([x, y, z + self.height_mm])
    }

    /// A way over that floor, around a middle, on the surface.
    fn way(&self, way: Path3, [x, y]: [f64; 2]) -> Path3 {
        let it = self.clone();
        Arc::new(move |t| {
            let at = way(t);
            it.place([at[0] - x, at[1] - y, at[2]])
        })
    }

    /// Half of the room.
    fn radius_mm(&self) -> f64 {
        self.room_mm.map_or(RADIUS_MM, |[x, y]| RADIUS_MM.min(0.5 * x.min(y)))
    }
}

/// A stroke where a graph has its surfaces; as it is where that reads no scene.
pub(crate) fn laid(spot: Option<&Spot>, stroke: &Stroke) -> Path3 {
    match spot {
        None => stroke.measured.clone(),
        Some(spot) => spot.way(stroke.measured.clone(), bounds(stroke).map(|[low, high]| 0.5 * (low + high))),
    }
}

/// A way along x whose surface is a floor; on a scene's surface it goes round, as far at any time.
pub(crate) fn along(spot: Option<&Spot>, way: Path3) -> Path3 {
    let Some(spot) = spot else { return way };
    let radius = spot.radius_mm();
    let round = move |t: f64| {
        let [x, _, z] = way(t);
        let (sin, cos) = (x / radius).sin_cos();
        [radius * cos, radius * sin, z]
    };
    spot.way(Arc::new(round), [0.0; 2])
}

/// A stylus that goes round and round at 80 mm/s, pressed to 1 N, so that nothing sleeps.
///
/// # Errors
/// Those of [`Spot::of`].
pub(crate) fn round(graph: &GraphFile, registry: &Registry) -> Result<Path3, Diagnostic> {
    let spot = Spot::of(graph, registry)?;
    let radius = spot.as_ref().map_or(RADIUS_MM, Spot::radius_mm);
    let way: Path3 = Arc::new(move |t| {
        let (sin, cos) = (t * ROUND_MM_S / radius).sin_cos();
        [radius * cos, radius * sin, -2.0]
    });
    Ok(match spot {
        None => way,
        Some(spot) => spot.way(way, [0.0; 2]),
    })
}

/// From where to where a stroke goes along x and y while it is pressed \[mm\].
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

/// The strokes of a study, where all of its graphs have room for them: those that are made by rule are made as large as that allows, and a note says so.
///
/// # Errors
/// A file that cannot be read; one that needs more room than a scene's surface has; those of [`Spot::of`].
pub(crate) fn strokes<'b>(
    study: &Study,
    graphs: impl Iterator<Item = &'b Base>,
    notes: &mut Vec<String>,
) -> Result<Vec<Stroke>, Diagnostic> {
    let mut spots = Vec::new();
    for base in graphs {
        spots.extend(Spot::of(&base.graph, &base.registry)?);
    }
    let mut strokes = Vec::new();
    for decl in &study.strokes {
        let mut stroke = decl.open()?;
        for spot in &spots {
            let Some(room) = spot.room_mm else { continue };
            let size = bounds(&stroke).map(|[low, high]| high - low);
            if size[0] <= room[0] && size[1] <= room[1] {
                continue;
            }
            let [x, y] = room;
            let Some(smaller) = decl.within(x.min(y)) else {
                return Err(Diagnostic::new(format!(
                    "`{}` is {:.0} by {:.0} mm, and `{}` has room for {x:.0} by {y:.0}",
                    stroke.name, size[0], size[1], spot.name
                ))
                .at(&decl.place.source, decl.place.span)
                .help("a stroke of a `shape` is made as large as there is room"));
            };
            stroke = smaller?;
            let large = stroke.made_mm.unwrap_or_default();
            notes.push(format!(
                "`{}` is made {large:.0} mm large: `{}` has no room for more",
                stroke.name, spot.name
            ));
        }
        strokes.push(stroke);
    }
    Ok(strokes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_diagnostics::Source;

    /// A scene's graph, the scene in a folder.
    fn graph(dir: &std::path::Path, surfaces: &str) -> GraphFile {
        let scene = format!(
            r#"Scene(version: 1, input: trajectory(file: "t.csv"), output: probe(), surfaces: {{{surfaces}}})"#
        );
        std::fs::write(dir.join("scene.ron"), scene).unwrap();
        let text =
            r#"Graph(version: 1, nodes: {"c": (kind: "contact", params: (scene: "scene.ron"))}, wires: [])"#;
        GraphFile::parse(&Source::new(dir.join("g.ron").display().to_string(), text)).unwrap()
    }

    fn relief(place: &str, more: &str) -> String {
        format!(
            r#"(shape: rectangle(size_mm: (20, 30)), place_mm: {place}, {more}
            effects: (stiffness: (stiffness_n_per_mm: 2.0), texture: relief(heights: made(surface: "canvas"))))"#
        )
    }

    #[test]
    fn strokes_lie_in_the_middle_of_the_first_surface_that_sounds() {
        let dir = tempfile::tempdir().unwrap();
        let dumb =
            r#"(shape: rectangle(size_mm: (20, 30)), effects: (stiffness: (stiffness_n_per_mm: 2.0)))"#;
        let surfaces = format!(r#""dumb": {dumb}, "right": {}"#, relief("(40, 5, 7)", ""));
        let graph = graph(dir.path(), &surfaces);
        let registry = asperity_nodes::registry();
        let spot = Spot::of(&graph, &registry).unwrap().unwrap();
        assert_eq!((spot.name.as_str(), spot.room_mm), ("right", Some([18.0, 28.0])));
        // As hard pressed: 1 mm of 0.5 N/mm is a quarter of a mm of 2 N/mm; above it nothing changes.
        assert_eq!(spot.place([1.0, 2.0, -1.0]), [41.0, 7.0, 6.75]);
        assert_eq!(spot.place([0.0, 0.0, 3.0]), [40.0, 5.0, 10.0]);
        // The lag's stylus goes round, as fast as along the line.
        let way = along(Some(&spot), Arc::new(|t| [100.0 * t, 0.0, -1.0]));
        let (mut longest, mut gone) = (0.0_f64, 0.0);
        for n in 0..1000 {
            let [a, b] = [n, n + 1].map(|n| way(f64::from(n) * 1e-3));
            longest = longest.max((a[0] - 40.0).abs()).max((a[1] - 5.0).abs());
            gone += (b[0] - a[0]).hypot(b[1] - a[1]);
        }
        assert!((gone - 100.0).abs() < 0.01 && longest <= 9.0 + 1e-9, "{gone} {longest}");
        let at = round(&graph, &registry).unwrap()(0.0);
        assert_eq!(at, [49.0, 5.0, 6.5]);
    }

    #[test]
    fn what_another_surface_lies_on_has_no_room() {
        let dir = tempfile::tempdir().unwrap();
        let two = format!(r#""a": {}, "b": {}"#, relief("(0, 0, 0)", ""), relief("(5, 0, 1)", ""));
        let spot = Spot::of(&graph(dir.path(), &two), &asperity_nodes::registry()).unwrap().unwrap();
        assert_eq!(spot.name, "b");
        let ball = r#""ball": (shape: sphere(radius_mm: 30), effects: (stiffness: (stiffness_n_per_mm: 2.0), texture: relief(heights: made(surface: "canvas"))))"#;
        let e = Spot::of(&graph(dir.path(), ball), &asperity_nodes::registry()).unwrap_err();
        assert!(e.to_string().contains("room for a stroke"), "{e}");
    }

    #[test]
    fn hills_are_no_flat_face() {
        let dir = tempfile::tempdir().unwrap();
        // Hills, and a face beside them.
        let hills = r#""hills": (shape: relief(heights: made(surface: "rubber pebble mat", side: 256, step_mm: 0.08), scale: 10.0, size_mm: (20, 20)),
            effects: (stiffness: (stiffness_n_per_mm: 2.0), texture: relief(heights: made(surface: "canvas"))))"#;
        let registry = asperity_nodes::registry();
        let both = format!("{hills}, \"flat\": {}", relief("(100, 0, 0)", ""));
        let spot = Spot::of(&graph(dir.path(), &both), &registry).unwrap().unwrap();
        assert_eq!(spot.name, "flat");
        let e = Spot::of(&graph(dir.path(), hills), &registry).unwrap_err().to_string();
        let scene = Scene::read(dir.path().join("scene.ron")).unwrap();
        let Form::Relief(relief) = scene.surfaces[0].surface.shape.form() else { panic!("no relief") };
        let [low, high] = relief.bounds_mm();
        assert!(high - low > 3.0, "{low} to {high} mm");
        assert!(e.contains("no relief"), "{e}");
    }

    #[test]
    fn a_stroke_is_made_as_large_as_there_is_room_and_a_file_that_has_none_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let graph = graph(dir.path(), &format!(r#""a": {}"#, relief("(0, 0, 0)", "")));
        let base = Base {
            name: "s".into(),
            file: graph.clone(),
            graph,
            registry: asperity_nodes::registry(),
            strength: 1.0,
            plugins: Vec::new(),
        };
        let study = |strokes: &str| {
            let text = format!("Study(version: 1, strokes: [{strokes}])");
            Study::parse(&Source::new(dir.path().join("s.ron").display().to_string(), text)).unwrap()
        };
        let mut notes = Vec::new();
        let made = study(r#"(name: "z", shape: zigzag, extent_mm: 60.0), (name: "c", extent_mm: 10.0)"#);
        let strokes = strokes(&made, std::iter::once(&base), &mut notes).unwrap();
        assert!(notes.len() == 1 && notes[0].contains("`z`") && notes[0].contains("`a`"), "{notes:?}");
        let spot = Spot::of(&base.graph, &base.registry).unwrap();
        for stroke in &strokes {
            let way = laid(spot.as_ref(), stroke);
            for n in 0..1000 {
                let [x, y, _] = way(f64::from(n) * 0.005);
                assert!(x.abs() <= 10.0 && y.abs() <= 15.0, "{} {x} {y}", stroke.name);
            }
        }
        let long = "t_s,x_mm,y_mm,z_mm\n0,0,0,-1\n1,100,0,-1\n2,0,0,-1\n";
        std::fs::write(dir.path().join("long.csv"), long).unwrap();
        let file = study(r#"(name: "mine", file: "long.csv")"#);
        let e = super::strokes(&file, std::iter::once(&base), &mut notes).unwrap_err().to_string();
        assert!(e.contains("`mine` is 100 by 0 mm") && e.contains("s.ron:1:"), "{e}");
    }
}
