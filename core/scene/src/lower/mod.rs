//! Lowers a scene to a graph with the nodes that the scene needs and no others.
//!
//! ```text
//! stylus -> motion -> contact
//! contact -> history -> texture -> phase -> audio rate -> network level -> textures
//! contact -> autoregressive a, b -> level -> textures       (waveform and relief alike)
//! contact -> friction, viscosity, magnet -> forces -> force limiter -> probe
//! contact -> tap, vibration -> acceleration
//! textures -> gate -> acceleration -> strength -> inverse -> limiter -> out
//! ```
//!
//! The graph has one `contact`, one network, and at most two voices of each other texture, however many
//! surfaces there are. The settings of an effect are a *slot* in the list of the effect's node. Surfaces
//! with the same settings share a slot.
//!
//! Accelerations add up and go to the actuator through one limiter. Textures pass one gate before that.
//! Forces add up and are limited to the device's largest. With [`Lowering::prune`] off, the graph also
//! has nodes for effects that no surface has. Their lists are empty.

mod acoustic;
mod builder;
mod forces;
mod look;
#[cfg(test)]
mod tests;

use crate::Scene;
use asperity_diagnostics::{Diagnostic, Place};
use asperity_graph::{GraphFile, PluginDecl};
use asperity_node::Registry;

use builder::Builder;

/// Options of lowering.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lowering {
    /// Leave out effects that no surface has.
    pub prune: bool,
}

impl Default for Lowering {
    fn default() -> Self {
        Self { prune: true }
    }
}

/// Graph of a scene.
#[derive(Clone, Debug)]
pub struct Lowered {
    /// The graph.
    pub graph: GraphFile,
    /// All kinds of effect. A kind that is not built has no nodes.
    pub rendered: Vec<Rendered>,
}

/// A kind of effect, and the nodes that render it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rendered {
    /// Name of the kind.
    pub kind: String,
    /// Whether it is a texture, which passes the gate.
    pub texture: bool,
    /// Ids of its nodes.
    pub nodes: Vec<String>,
}

/// Graph of a scene as far as it can be known without kinds of nodes: the plugins that the scene asks
/// for.
///
/// # Errors
/// `plugins` is not a list of names.
pub fn draft(scene: &Scene) -> Result<GraphFile, Diagnostic> {
    let mut graph = GraphFile::empty(&scene.source.path().display().to_string());
    graph.source = scene.source.clone();
    (graph.tick_hz, graph.audio_hz, graph.seed) = (scene.tick_hz, scene.audio_hz, scene.seed);
    if let Some(plugins) = &scene.plugins {
        for value in plugins.list()? {
            let place = Place { source: value.source().clone(), span: value.span() };
            graph.plugins.push(PluginDecl { name: value.text()?.to_owned(), place });
        }
    }
    Ok(graph)
}

/// Lowers a scene to its graph.
///
/// # Errors
/// - [`Scene::check`] finds an error.
/// - A part is of an unknown kind, or of a kind that cannot do its job. `input` must tell a position,
///   `phase` must make a signal of magnitudes, and `output` must play.
/// - A setting is unknown or does not fit, even if the scene does not need the part.
/// - The network's library does not have a material.
/// - The scene has nothing to feel.
/// - `plugins` is not a list of names.
pub fn lower(scene: &Scene, registry: &Registry, lowering: Lowering) -> Result<Lowered, Diagnostic> {
    scene.check(registry)?;
    let mut builder = Builder::new(scene, registry, lowering, draft(scene)?);
    builder.look()?;
    builder.hand()?;
    builder.forces()?;
    builder.acoustic()?;
    builder.done()
}
