//! Checks the settings of a file against a descriptor.

use std::path::{Path, PathBuf};

use asperity_diagnostics::file::{irregular, is_stdin};
use asperity_diagnostics::{Diagnostic, nearest, one_of};
use asperity_node::{Descriptor, Param, ParamKind, ParamValue, Params, Registry};

use crate::{NodeDecl, Setting, slots};

/// Checks the settings of a node of some kind, in a graph or not: unknown names, and values that do not
/// fit. Missing settings are not errors, and files are not checked.
pub fn check_settings(settings: &[Setting], descriptor: &Descriptor) -> Vec<Diagnostic> {
    let mut errors = unknown(settings, descriptor);
    for setting in settings {
        let is_this = |p: &&Param| p.name == setting.name && !matches!(p.kind, ParamKind::File);
        let param = descriptor.params.iter().find(is_this);
        errors.extend(param.and_then(|param| read(setting, param, None).err()));
    }
    errors
}

/// Errors about settings without a parameter.
fn unknown(settings: &[Setting], descriptor: &Descriptor) -> Vec<Diagnostic> {
    let names: Vec<&str> = descriptor.params.iter().map(|p| p.name.as_ref()).collect();
    let unknown = settings.iter().filter(|setting| !names.contains(&setting.name.as_str()));
    unknown
        .map(|setting| {
            Diagnostic::new(format!("`{}` has no parameter `{}`", descriptor.kind, setting.name))
                .at_place(&setting.place)
                .label("unknown parameter")
                .help(one_of(&setting.name, names.iter().copied()))
        })
        .collect()
}

/// Checks a node's settings. Errors are added to `errors`.
pub(crate) fn check(
    node: &NodeDecl,
    descriptor: &Descriptor,
    registry: &Registry,
    errors: &mut Vec<Diagnostic>,
) -> Params {
    errors.extend(unknown(&node.params, descriptor));
    let mut params = Params::new(Some(node.place.clone()));
    for param in &descriptor.params {
        let setting = node.params.iter().find(|s| s.name == param.name);
        let mut value = param.default.clone();
        match setting.map(|s| read(s, param, Some(registry))) {
            Some(Ok(read)) => value = Some(read),
            Some(Err(e)) => errors.push(e),
            None if value.is_none() && !param.optional => errors.push(
                Diagnostic::new(format!("`{}` needs the parameter `{}`", node.kind, param.name))
                    .at_place(&node.place)
                    .label(format!("no `{}` set", param.name))
                    .help(param.doc.to_string()),
            ),
            None => {}
        }
        params.insert(param.name.to_string(), value, setting.map(|s| s.value.place()));
    }
    match slots::read(&node.params, descriptor) {
        Ok(slots) => params.set_slots(slots),
        // Of a list that is no list it is said already.
        Err(e) if errors.is_empty() => errors.push(e),
        Err(_) => {}
    }
    params
}

fn read(setting: &Setting, param: &Param, registry: Option<&Registry>) -> Result<ParamValue, Diagnostic> {
    match &param.kind {
        ParamKind::Text => text(setting).map(|t| ParamValue::Text(t.to_owned())),
        ParamKind::File => file(setting, text(setting)?, registry).map(ParamValue::File),
        _ => param.read(&setting.value),
    }
}

/// Reads a text; on a command line, the text as typed.
fn text(setting: &Setting) -> Result<&str, Diagnostic> {
    match &setting.typed {
        Some(typed) if setting.value.text().is_err() => Ok(typed),
        _ => setting.value.text(),
    }
}

/// Reads the path of an existing file, relative to the file that names it; or of a shipped file.
fn file(setting: &Setting, text: &str, registry: Option<&Registry>) -> Result<PathBuf, Diagnostic> {
    let value = &setting.value;
    let is_typed = setting.typed.is_some() || value.source().path() == Path::new("-");
    let base_is = if is_typed { "where the program runs" } else { "the graph file" };
    let base = value.source().path().parent().unwrap_or(Path::new(""));
    let path = base.join(text);
    if is_stdin(&path) {
        return Ok(path);
    }
    match std::fs::metadata(&path) {
        Ok(meta) => match irregular(&meta) {
            None => Ok(path),
            Some(what) => Err(value.error(format!("{} is {what}", path.display()))),
        },
        Err(e) => {
            if let Some(shipped) = registry.and_then(|registry| registry.shipped_file(Path::new(text))) {
                return Ok(shipped);
            }
            let d = value.error(format!("cannot find the file {}: {e}", path.display()));
            Err(match neighbour(&path) {
                Some(name) => d.help(format!("did you mean `{name}`? Paths are relative to {base_is}")),
                None => d.help(format!("paths are relative to {base_is}")),
            })
        }
    }
}

fn neighbour(path: &Path) -> Option<String> {
    let wanted = path.file_name()?.to_str()?;
    let dir = path.parent().filter(|d| !d.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let names: Vec<String> = std::fs::read_dir(dir)
        .ok()?
        .take(10_000)
        .filter_map(|e| e.ok()?.file_name().into_string().ok())
        .collect();
    nearest(wanted, names.iter().map(String::as_str)).map(str::to_owned)
}
