//! Effects in the interface's form: the extension `asperity.effect/1`.

use std::ptr;

use asperity_abi::*;
use asperity_node::{Acts, Descriptor, Direction, Form, Node};

use crate::describe::{Record, leak, param};
use crate::panics::guarded;
use crate::setup::{SlotSettings, tell};
use crate::text::{Texts, Theirs};

/// The effect of a node type, never freed; NULL for a type that is none.
pub(crate) fn effect<N: Node>(d: &Descriptor, texts: &mut Texts) -> *const AsperityEffect {
    let Some(effect) = &d.effect else { return ptr::null() };
    let form = |form: &Form, texts: &mut Texts| {
        assert!(form.nested.is_empty(), "the plugin interface has no nested fields");
        AsperityForm {
            field_count: form.fields.len() as u32,
            name: texts.text(&form.name),
            fields: leak(form.fields.iter().map(|field| param(field, texts)).collect()),
            example: texts.text(&form.example),
            ..blank()
        }
    };
    let forms = effect.forms.iter().map(|it| form(it, texts)).collect();
    let needs = effect.needs.iter().map(|(input, quantity)| AsperityNeed {
        input: texts.text(input),
        quantity: texts.text(quantity),
        ..blank()
    });
    let needs = leak(needs.collect());
    leak(vec![AsperityEffect {
        acts: match effect.acts {
            Acts::Touching => ASPERITY_TOUCHING,
            Acts::Inside => ASPERITY_INSIDE,
            Acts::Near => ASPERITY_NEAR,
            Acts::Gliding => ASPERITY_GLIDING,
        },
        list: texts.text(&effect.list),
        form_count: effect.forms.len() as u32,
        need_count: effect.needs.len() as u32,
        forms: leak(forms),
        needs,
        direction: match effect.direction() {
            None => 0,
            Some(Direction::Normal) => ASPERITY_NORMAL,
            Some(Direction::Surface) => ASPERITY_SURFACE,
            Some(Direction::Any) => ASPERITY_ANY,
        },
        law: effect.direction().map(|_| law::<N> as _),
        check: Some(check::<N>),
        ..blank()
    }])
}

/// See [`AsperityEffects::effect`].
pub(crate) unsafe extern "C" fn of_kind(kind: *const AsperityKind) -> *const AsperityEffect {
    // SAFETY: the host passes a kind of this plugin, which is a record.
    unsafe { kind.cast::<Record>().as_ref() }.map_or(ptr::null(), |record| record.effect)
}

/// See [`AsperityEffect::law`].
unsafe extern "C" fn law<N: Node>(
    _kind: *const AsperityKind,
    settings: *const AsperitySettings,
    normal_force_n: f64,
    law: *mut AsperityLaw,
) -> i32 {
    guarded(|| {
        // SAFETY: the host's structs, valid during this call.
        let theirs = unsafe { Theirs::trusted() };
        let effect = N::descriptor().effect?;
        let read = SlotSettings::read(theirs, settings, &effect.forms)?;
        let (_, told) = effect.law_of(&read.settings, normal_force_n)?;
        // SAFETY: as above. The host's struct may be shorter than ours.
        (!law.is_null()).then(|| unsafe {
            (&raw mut (*law).stiffness_n_per_mm).write(told.stiffness_n_per_mm);
            (&raw mut (*law).damping_ns_per_m).write(told.damping_ns_per_m);
            ASPERITY_OK
        })
    })
}

/// See [`AsperityEffect::check`].
unsafe extern "C" fn check<N: Node>(
    _kind: *const AsperityKind,
    settings: *const AsperitySettings,
    error: *mut AsperityError,
) -> i32 {
    guarded(|| {
        // SAFETY: the host's structs, valid during this call.
        let theirs = unsafe { Theirs::trusted() };
        let effect = N::descriptor().effect?;
        let read = SlotSettings::read(theirs, settings, &effect.forms)?;
        effect.checked(&read.settings).map_err(|d| tell(theirs, &d, &read.sources, error)).ok()?;
        Some(ASPERITY_OK)
    })
}
