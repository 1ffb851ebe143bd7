//! The scene of a run from above: surfaces for the pages, and heights for the hand.

use asperity_plot::{bounds, outline};
use asperity_scene::space::{Form, Surface, WORLD_MM};
use asperity_scene::{NETWORK, Rendered, Scene, Touchable};
use rstar::RTree;
use rstar::primitives::{GeomWithData, Rectangle};
use serde::Deserialize;
use serde_json::{Value, json};

/// Most surfaces that a page draws: the nearest to the middle of its view.
const MOST: usize = 400;
/// Steps down to a surface. Fewer suffice but for places where it is very steep.
const STEPS: usize = 64;
/// Distance from a surface that counts as none \[mm\].
const NONE_MM: f64 = 1e-4;

/// A scene from above.
#[derive(Debug)]
pub struct Map {
    surfaces: Vec<Seen>,
    /// Numbers of the surfaces with an outline, by their bounds.
    bounded: RTree<GeomWithData<Rectangle<[f64; 2]>, usize>>,
    /// Numbers of those that are everywhere: planes.
    everywhere: Vec<usize>,
    effects: Value,
}

/// A surface as a page and a hand see it.
#[derive(Debug)]
struct Seen {
    surface: Surface,
    /// Whether the stylus passes through it.
    soft: bool,
    /// Drawn on the page.
    drawn: Value,
}

/// The middle of a page's view \[mm\].
#[derive(Clone, Copy, Debug, Deserialize)]
pub(crate) struct Around {
    pub(crate) x: f64,
    pub(crate) y: f64,
}

impl Map {
    /// A map of a scene. The nodes of each effect are those that are called just while it acts.
    #[must_use]
    pub fn new(scene: &Scene, rendered: &[Rendered]) -> Self {
        let (mut bounded, mut everywhere) = (Vec::new(), Vec::new());
        for (number, of) in scene.surfaces.iter().enumerate() {
            match outline(&of.surface).and_then(|points| bounds(points.into_iter())) {
                Some([low, high]) => {
                    bounded.push(GeomWithData::new(Rectangle::from_corners(low, high), number))
                }
                None => everywhere.push(number),
            }
        }
        let effect = |of: &Rendered| json!({ "name": said(&of.kind), "nodes": of.nodes });
        Self {
            surfaces: scene.surfaces.iter().enumerate().map(|(number, of)| Seen::new(number, of)).collect(),
            bounded: RTree::bulk_load(bounded),
            everywhere,
            effects: rendered.iter().map(effect).collect(),
        }
    }

    /// The part of the map around a place, for a page.
    pub(crate) fn around(&self, [x, y]: [f64; 2]) -> Value {
        let at = [x, y].map(|v| if v.is_finite() { v.clamp(-WORLD_MM, WORLD_MM) } else { 0.0 });
        let nearest = self.bounded.nearest_neighbor_iter(at).map(|of| of.data);
        let mut numbers: Vec<usize> = self.everywhere.iter().copied().chain(nearest).take(MOST).collect();
        // In the order of the scene, so that the page does not depend on the place.
        numbers.sort_unstable();
        let drawn: Vec<&Value> = numbers.iter().map(|number| &self.surfaces[*number].drawn).collect();
        json!({
            "surfaces": drawn,
            "all": self.surfaces.len(),
            "effects": self.effects,
            "middle": self.middle(),
        })
    }

    /// The middle of all surfaces with an end.
    fn middle(&self) -> [f64; 2] {
        let all = self.bounded.root().envelope();
        let middle = [0, 1].map(|k| 0.5 * (all.lower()[k] + all.upper()[k]));
        if middle.iter().all(|v| v.abs() <= WORLD_MM) { middle } else { [0.0; 2] }
    }

    /// Height of the scene over a place \[mm\]: of its highest wall there, else of any surface there, else 0.
    pub(crate) fn height_mm(&self, [x, y]: [f64; 2]) -> f64 {
        let there = self.bounded.locate_all_at_point([x, y]).map(|of| of.data);
        let there: Vec<&Seen> =
            there.chain(self.everywhere.iter().copied()).map(|number| &self.surfaces[number]).collect();
        let highest = |soft: bool| {
            let tops = there.iter().filter(|of| of.soft == soft).filter_map(|of| top_mm(&of.surface, [x, y]));
            tops.reduce(f64::max)
        };
        highest(false).or_else(|| highest(true)).unwrap_or(0.0)
    }
}

impl Seen {
    fn new(number: usize, of: &Touchable) -> Self {
        let effects = &of.effects;
        let wall = [("stiffness", &effects.stiffness), ("damping", &effects.damping)];
        let wall = wall.into_iter().filter(|(_, is)| is.is_some()).map(|(name, _)| name.to_owned());
        let [x, y, _] = of.surface.pose.place_mm();
        let mut drawn = json!({
            "number": number,
            "name": of.name,
            "material": of.material.as_ref().map(|material| &material.of),
            "effects": wall.chain(effects.named.iter().map(|named| said(&named.kind))).collect::<Vec<_>>(),
            "soft": effects.stiffness.is_none(),
            "place": [x, y],
        });
        match of.surface.shape.form() {
            Form::Sphere { radius_mm } => drawn["radius"] = json!(radius_mm),
            _ => drawn["outline"] = json!(outline(&of.surface)),
        }
        Self { surface: of.surface.clone(), soft: effects.stiffness.is_none(), drawn }
    }
}

/// An effect as a person knows it.
fn said(kind: &str) -> String {
    if kind == NETWORK { "network texture".to_owned() } else { kind.to_owned() }
}

/// Height of a surface's upper side over a place, if it has one there. It goes down from far above by the
/// distance to the surface, so that no shape needs a formula of its own.
fn top_mm(surface: &Surface, [x, y]: [f64; 2]) -> Option<f64> {
    let mut z = 2.0 * WORLD_MM;
    // A plane that faces down is entered from below.
    if surface.depth_mm([x, y, z]) >= 0.0 {
        return None;
    }
    for _ in 0..STEPS {
        let depth = surface.depth_mm([x, y, z]);
        if depth >= -NONE_MM {
            return Some(z);
        }
        z += depth;
        if z < -2.0 * WORLD_MM {
            return None;
        }
    }
    None
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use asperity_diagnostics::Source;

    pub(crate) fn map(surfaces: &str) -> Map {
        let text = format!(
            "Scene(version: 1, input: stroke(extent_mm: 60, speed_mm_s: 50, duration_s: 1), \
             device: (damping_ns_per_m: 2), surfaces: {{ {surfaces} }})"
        );
        Map::new(&Scene::parse(&Source::new("s.ron", &text)).expect("a scene"), &[])
    }

    const WALL: &str = "effects: (stiffness: (stiffness_n_per_mm: 0.5))";

    #[test]
    fn height_is_that_of_the_highest_wall() {
        let map = map(&format!(
            "\"table\": (shape: rectangle(size_mm: (100, 100)), place_mm: (0, 0, -5), {WALL}),
             \"ball\": (shape: sphere(radius_mm: 10), place_mm: (20, 0, 0), {WALL}),
             \"block\": (shape: box(size_mm: (20, 20, 6)), place_mm: (-20, 0, 12), {WALL}),
             \"ramp\": (shape: rectangle(size_mm: (20, 20)), place_mm: (0, 40, 0), \
                turn_deg: (0, 45, 0), {WALL}),
             \"honey\": (shape: box(size_mm: (100, 20, 80)), place_mm: (0, -40, 0), \
                effects: (viscosity: (viscosity_ns_per_m: 1)))"
        ));
        for (at, height) in [
            ([0.0, 0.0], -5.0),
            ([20.0, 0.0], 10.0),
            ([26.0, 0.0], 8.0),
            ([-20.0, 5.0], 15.0),
            ([3.0, 40.0], -3.0),
            // A wall counts before what is soft.
            ([0.0, -40.0], -5.0),
            ([0.0, 400.0], 0.0),
            ([f64::NAN, 0.0], 0.0),
        ] {
            let found = map.height_mm(at);
            assert!((found - height).abs() < 1e-3, "{at:?}: {found}, not {height}");
        }
    }

    #[test]
    fn map_has_the_nearest_surfaces_and_every_plane() {
        let tile = |i: i32| {
            let [x, y] = [10 * (i % 100), 10 * (i / 100)];
            format!("\"t{i}\": (shape: rectangle(size_mm: (10, 10)), place_mm: ({x}, {y}, 0), {WALL}),")
        };
        let tiles: String = (0..3000).map(tile).collect();
        let map = map(&format!("{tiles} \"floor\": (shape: plane, place_mm: (0, 0, -9), {WALL})"));
        let part = map.around([990.0, 290.0]);
        let names: Vec<&str> =
            part["surfaces"].as_array().unwrap().iter().map(|of| of["name"].as_str().unwrap()).collect();
        assert_eq!((names.len(), part["all"].as_u64()), (MOST, Some(3001)));
        assert!(names.contains(&"t2999") && names.contains(&"floor") && !names.contains(&"t0"));
        assert_eq!(part["middle"], json!([495.0, 145.0]));
        let odd = map.around([f64::NAN, f64::INFINITY]);
        assert_eq!(odd["surfaces"].as_array().unwrap().len(), MOST);
    }
}
