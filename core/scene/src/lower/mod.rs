//! From a scene to a graph: the nodes that it calls for and no others.
//!
//! ```text
//! stylus -> motion -> contact -+-> history -> texture -> phase -> audio rate -> network level -+
//!    |                   ^     +-> autoregressive a, b -> level ------------------------------+-> textures -> gate -+
//!    +-------------------+     +-> waveform a, b -> level ------------------------------------+                     |
//!                              +-> relief a, b -> level --------------------------------------+                     |
//!                              +-> tap ------------------------------------------------------------ acceleration <--+
//!                              +-> vibration ------------------------------------------------------/      |
//!                              |                                                  strength -> inverse -> limiter -> out
//!                              +-> friction, viscosity, magnet -> force -> force limiter -> probe
//! ```
//!
//! Whatever the number of surfaces there is one `contact`, one network, and at most two voices of the other textures: what a surface has of an effect is a *slot*
//! in a list of the effect's node, which surfaces of the same settings share. Accelerations add and go to the actuator through one gate
//! (textures), one limiter; forces add and are held to the device's largest. With [`Lowering::prune`] off, nodes of effects that no surface has are there
//! too, with empty lists.

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
/// What [`Scene::check`] finds; a part of a kind that is not there or that cannot do what it is for (`input` tells a position, `phase` makes a signal of magnitudes, `output` plays), a setting
/// that it does not have or that does not fit, also where nothing of the scene needs the part; a material that the network's library does not have; nothing that
/// can be felt; a list of plugins that is none.
pub fn lower(scene: &Scene, registry: &Registry, lowering: Lowering) -> Result<Lowered, Diagnostic> {
    scene.check(registry)?;
    let mut builder = Builder::new(scene, registry, lowering, draft(scene)?);
    builder.look()?;
    builder.hand()?;
    builder.forces()?;
    builder.acoustic()?;
    builder.done()
}
