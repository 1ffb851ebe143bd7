//! `asperity compare`: every phase-retrieval node over the same magnitudes, side by side.
//!
//! [`vectors`] are what is compared on, [`contest`] runs all methods over them and measures [`lag`], the
//! rest shows the rows that come of it.

mod builtin;
mod contest;
mod files;
mod lag;
mod picture;
mod published;
mod table;
#[cfg(test)]
mod tests;
mod vectors;

use std::path::Path;
use std::process::ExitCode;

use asperity_diagnostics::Diagnostic;
use asperity_node::Registry;

use crate::args::Compare;
use crate::failure::{Failure, print};
use crate::kinds::Kinds;
use crate::output::{Pending, keep_all, resolved};
use crate::phase::{Chain, How, Method, retrievers};
use vectors::Set;

/// Runs the command.
pub fn run(args: &Compare) -> Result<ExitCode, Failure> {
    let mut kinds = Kinds::new(&args.plugins.plugin);
    let registry = kinds.registry(None)?;
    let set = match &args.vectors {
        Some(dir) => vectors::read(dir)?,
        None => builtin::set()?,
    };
    let methods = methods(&registry, &args.phase, &set)?;
    let (svg, csv) = (args.svg.as_deref(), args.csv.as_deref());
    if let (Some(a), Some(b)) = (svg, csv)
        && resolved(a) == resolved(b)
    {
        return Err(Diagnostic::new("the picture and the table cannot both go here").in_file(a).into());
    }
    // A picture among the vectors does no harm; one in the place of what is read does.
    for path in [svg, csv].into_iter().flatten() {
        let at = resolved(path);
        let plugin = kinds.files().iter().any(|f| resolved(f) == at);
        let vectors =
            args.vectors.as_ref().is_some_and(|dir| at.parent() == Some(&resolved(dir)) && at.exists());
        if plugin || vectors {
            return Err(Diagnostic::new("this file is there already, and may be what is compared")
                .in_file(path)
                .help("name another file")
                .into());
        }
    }
    // Before minutes of work, so that a folder that is not there is told of at once.
    let pending = |path: Option<&Path>| path.map(Pending::create).transpose();
    let (svg, csv) = (pending(svg)?, pending(csv)?);

    let outcome = contest::run(&registry, &methods, &set, args.quiet)?;
    let published = contest::published(&set);
    let (mut files, mut wrote) = (Vec::new(), String::new());
    let texts = [(svg, &args.svg, picture::svg as fn(_, _, _) -> _), (csv, &args.csv, files::csv)];
    for (pending, path, text) in texts {
        if let (Some(pending), Some(path)) = (pending, path) {
            files.push(pending.fill(&text(&set, &outcome, &published[..]))?);
            wrote += &format!("wrote {}\n", path.display());
        }
    }
    keep_all(files)?;
    if args.json {
        print(&format!("{:#}\n", files::json(&set, &outcome, &published)))?;
    } else {
        print(&format!("{}{wrote}", table::text(&set, &outcome, &published)))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Every kind that retrieves phase with all defaults, and what the user asks for beside them.
///
/// # Errors
/// What a user asks for and cannot be made. A kind that fails without being asked for is left to its row.
fn methods(registry: &Registry, asked: &[String], set: &Set) -> Result<Vec<Method>, Failure> {
    let kinds = retrievers(registry);
    let mut all = kinds.iter().map(|d| Method::parse(&d.kind, registry)).collect::<Result<Vec<_>, _>>()?;
    for text in asked {
        let method = Method::parse(text, registry)?;
        if all.iter().all(|m| m.label != method.label) {
            if let (How::Node(_), Some(vector)) = (&method.how, set.vectors.first()) {
                Chain::new(registry, &method, &vector.frames, 1)?;
            }
            all.push(method);
        }
    }
    if all.is_empty() {
        return Err(Failure::Machine("there is no phase-retrieval node".into()));
    }
    Ok(all)
}
