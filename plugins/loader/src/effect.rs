//! Effects of a plugin: its extension `asperity.effect/1`.

use std::sync::Arc;

use asperity_abi::*;
use asperity_node::{Acts, Diagnostic, Direction, Effect, Form, Law, Settings};

use crate::checked::{Lie, Theirs};
use crate::describe;
use crate::foreign::foreign;
use crate::said::Said;
use crate::setup;

/// A kind and the functions of its effect.
#[derive(Clone, Copy)]
struct At {
    kind: *const AsperityKind,
    abi: AsperityEffect,
}

// SAFETY: constant data of a library that is never unloaded; its functions may be called from any thread.
unsafe impl Send for At {}
// SAFETY: as above.
unsafe impl Sync for At {}

/// The effect of a kind, if it is one.
pub(crate) fn effect(
    theirs: Theirs,
    kind: *const AsperityKind,
    extension: &AsperityEffects,
) -> Result<Option<Effect>, Lie> {
    let Some(effect) = extension.effect else { return Ok(None) };
    // SAFETY: the function is the extension's of that name, and the kind the plugin's.
    let at = foreign(|| unsafe { effect(kind) });
    if at.is_null() {
        return Ok(None);
    }
    let abi = theirs.read(at, "its effect")?;
    let list = theirs.text(abi.list, "the list of its effect")?;
    let forms = theirs.read_all(abi.forms, abi.form_count, "form")?;
    let needs = theirs.read_all(abi.needs, abi.need_count, "need")?;
    let acts = match abi.acts {
        ASPERITY_TOUCHING => Acts::Touching,
        ASPERITY_INSIDE => Acts::Inside,
        ASPERITY_NEAR => Acts::Near,
        ASPERITY_GLIDING => Acts::Gliding,
        other => return Err(format!("its effect acts at {other}, which this version does not know")),
    };
    let mut effect = Effect::new(list, acts);
    for of in &forms {
        effect = effect.form(form(theirs, of)?);
    }
    for need in &needs {
        let input = theirs.text(need.input, "the input of a need")?;
        let quantity = theirs.text(need.quantity, "a quantity")?;
        effect = effect.needs(input, quantity);
    }
    let (at, forms) = (At { kind, abi }, Arc::<[Form]>::from(effect.forms.clone()));
    if abi.law.is_some() {
        let direction = match abi.direction {
            ASPERITY_NORMAL => Direction::Normal,
            ASPERITY_SURFACE => Direction::Surface,
            ASPERITY_ANY => Direction::Any,
            other => {
                return Err(format!("its force has the direction {other}, which this version does not know"));
            }
        };
        let forms = forms.clone();
        effect = effect.law(direction, move |settings, normal_n| law(at, &forms, settings, normal_n));
    }
    if abi.check.is_some() {
        effect = effect.check(move |settings| check(at, &forms, settings));
    }
    Ok(Some(effect))
}

fn form(theirs: Theirs, abi: &AsperityForm) -> Result<Form, Lie> {
    let name = theirs.text(abi.name, "the name of a form")?;
    let example = theirs.text(abi.example, &format!("the example of form `{name}`"))?;
    let fields = theirs.read_all(abi.fields, abi.field_count, "field")?;
    fields
        .iter()
        .try_fold(Form::new(name, example), |form, field| Ok(form.field(describe::param(theirs, field)?)))
}

/// The law for some settings. An effect that cannot tell it counts as one that no device bears.
fn law(at: At, forms: &[Form], settings: &Settings, normal_force_n: f64) -> Law {
    let unbearable = Law { stiffness_n_per_mm: f64::INFINITY, damping_ns_per_m: 0.0 };
    let mut told: AsperityLaw = blank();
    let (Some(law), Ok(lent)) = (at.abi.law, setup::settings(settings, forms)) else { return unbearable };
    // SAFETY: all live through the call.
    let answer = foreign(|| unsafe { law(at.kind, &lent.abi, normal_force_n, &mut told) });
    let law = Law { stiffness_n_per_mm: told.stiffness_n_per_mm, damping_ns_per_m: told.damping_ns_per_m };
    let fits = law.stiffness_n_per_mm >= 0.0 && law.damping_ns_per_m.is_finite();
    if answer == ASPERITY_OK && fits { law } else { unbearable }
}

fn check(at: At, forms: &[Form], settings: &Settings) -> Result<(), Diagnostic> {
    let Some(check) = at.abi.check else { return Ok(()) };
    let lent = setup::settings(settings, forms).map_err(|lie| settings.node_error(lie))?;
    let mut said = Said::new();
    // SAFETY: all live through the call.
    match foreign(|| unsafe { check(at.kind, &lent.abi, &mut said.abi) }) {
        ASPERITY_OK => Ok(()),
        _ => {
            let form = forms.iter().find(|form| form.name == settings.form());
            let fields = form.map_or(&[][..], |form| &form.fields);
            Err(said.diagnostic(settings, fields, "the plugin refuses these settings"))
        }
    }
}
