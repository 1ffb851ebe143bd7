//! From a scene to a graph: the nodes that it calls for and no others.
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
//! However many surfaces there are, the graph has one `contact`, one network, and at most two voices of each other
//! texture. The settings of an effect are a *slot* in the list of the effect's node. Surfaces with the same settings
//! share a slot. Accelerations add up and go to the actuator through one limiter, textures through one gate before.
//! Forces add up and are held to the device's largest. With [`Lowering::prune`] off, the graph also has nodes for
//! effects that no surface has, with empty lists.

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

/// How to lower.
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

/// A graph that a scene came to.
#[derive(Clone, Debug)]
pub struct Lowered {
    /// It.
    pub graph: GraphFile,
    /// Every kind of effect. One that is not built has no nodes.
    pub rendered: Vec<Rendered>,
}

/// A kind of effect, and the nodes that render it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rendered {
    /// Its name.
    pub kind: String,
    /// Whether it is a texture, which goes through the gate.
    pub texture: bool,
    /// Ids of its nodes.
    pub nodes: Vec<String>,
}

/// The graph of a scene as far as it can be known without kinds of nodes: the plugins that it asks for.
///
/// # Errors
/// A list that is none of names.
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

/// The graph of a scene.
///
/// # Errors
/// - a finding of [`Scene::check`];
/// - a part of an unknown kind, or of a kind that cannot do its job: `input` tells a position, `phase` makes a signal
///   of magnitudes, `output` plays;
/// - a setting that is unknown or does not fit, even if the scene does not need the part;
/// - a material that the network's library does not have;
/// - a scene without anything to feel;
/// - `plugins` that is not a list of names.
pub fn lower(scene: &Scene, registry: &Registry, lowering: Lowering) -> Result<Lowered, Diagnostic> {
    scene.check(registry)?;
    let mut builder = Builder::new(scene, registry, lowering, draft(scene)?);
    builder.look()?;
    builder.hand()?;
    builder.forces()?;
    builder.acoustic()?;
    builder.done()
}
