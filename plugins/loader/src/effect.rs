//! Effects of a plugin: its extension `asperity.effect/1`.

use std::sync::Arc;

use asperity_abi::*;
use asperity_node::{Acts, Diagnostic, Direction, Effect, Form, Law, Settings};

use crate::checked::{self, Lie};
use crate::describe;
use crate::foreign::foreign;
use crate::said::Said;
use crate::setup::LentSettings;

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
///
/// # Safety
/// `kind` is the plugin's, and `extension` the one of that name.
pub(crate) unsafe fn effect(
    kind: *const AsperityKind,
    extension: &AsperityEffects,
) -> Result<Option<Effect>, Lie> {
    let Some(effect) = extension.effect else { return Ok(None) };
    // SAFETY: the caller's promise.
    let at = foreign(|| unsafe { effect(kind) });
    if at.is_null() {
        return Ok(None);
    }
    // SAFETY: what the function answers stays, and so does all that it leads to.
    let (abi, list, forms, needs) = unsafe {
        let abi = checked::read(at, "its effect")?;
        (
            abi,
            checked::text(abi.list, "the list of its effect")?,
            checked::read_all(abi.forms, abi.form_count, "form")?,
            checked::read_all(abi.needs, abi.need_count, "need")?,
        )
    };
    let acts = match abi.acts {
        ASPERITY_TOUCHING => Acts::Touching,
        ASPERITY_INSIDE => Acts::Inside,
        ASPERITY_NEAR => Acts::Near,
        ASPERITY_GLIDING => Acts::Gliding,
        other => return Err(format!("its effect acts at {other}, which this version does not know")),
    };
    let mut effect = Effect::new(list, acts);
    for of in &forms {
        // SAFETY: as above.
        effect = effect.form(unsafe { form(of)? });
    }
    for need in &needs {
        // SAFETY: as above.
        let (input, quantity) = unsafe {
            (checked::text(need.input, "the input of a need")?, checked::text(need.quantity, "a quantity")?)
        };
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

/// # Safety
/// Everything that `abi` points to is valid and stays.
unsafe fn form(abi: &AsperityForm) -> Result<Form, Lie> {
    // SAFETY: the caller's promise.
    unsafe {
        let name = checked::text(abi.name, "the name of a form")?;
        let example = checked::text(abi.example, &format!("the example of form `{name}`"))?;
        let mut form = Form::new(name, example);
        for field in &checked::read_all(abi.fields, abi.field_count, "field")? {
            form = form.field(describe::param(field)?);
        }
        Ok(form)
    }
}

/// The law for some settings. An effect that cannot tell it counts as one that no device bears.
fn law(at: At, forms: &[Form], settings: &Settings, normal_force_n: f64) -> Law {
    let unbearable = Law { stiffness_n_per_mm: f64::INFINITY, damping_ns_per_m: 0.0 };
    let mut told: AsperityLaw = blank();
    let (Some(law), Ok(lent)) = (at.abi.law, LentSettings::new(settings, forms)) else { return unbearable };
    // SAFETY: all live through the call.
    let answer = foreign(|| unsafe { law(at.kind, &lent.abi, normal_force_n, &mut told) });
    let law = Law { stiffness_n_per_mm: told.stiffness_n_per_mm, damping_ns_per_m: told.damping_ns_per_m };
    let fits = law.stiffness_n_per_mm >= 0.0 && law.damping_ns_per_m.is_finite();
    if answer == ASPERITY_OK && fits { law } else { unbearable }
}

fn check(at: At, forms: &[Form], settings: &Settings) -> Result<(), Diagnostic> {
    let Some(check) = at.abi.check else { return Ok(()) };
    let lent = LentSettings::new(settings, forms).map_err(|lie| settings.node_error(lie))?;
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
