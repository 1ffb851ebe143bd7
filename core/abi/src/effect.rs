//! Effects: kinds that a surface of a scene can have.

use std::ffi::c_char;

use crate::{AsperityError, AsperityKind, AsperityParam, AsperityValue};

/// Name of [`AsperityEffects`].
pub const ASPERITY_EXTENSION_EFFECT: &str = "asperity.effect/1";

/// Acts while a wall is touched. A wall is a surface with a stiffness.
pub const ASPERITY_TOUCHING: u32 = 1;
/// Acts while a wall is touched, and inside of a volume, a surface without a stiffness.
pub const ASPERITY_INSIDE: u32 = 2;
/// Acts from both sides of a surface, as far as the field `reach_mm` says.
pub const ASPERITY_NEAR: u32 = 3;
/// Acts while a stylus glides over a wall: a texture.
pub const ASPERITY_GLIDING: u32 = 4;

/// The force acts along the surface's normal.
pub const ASPERITY_NORMAL: u32 = 1;
/// The force acts along the surface.
pub const ASPERITY_SURFACE: u32 = 2;
/// The force acts against any motion.
pub const ASPERITY_ANY: u32 = 3;

/// The plugin's extension `asperity.effect/1`: kinds that are effects of surfaces.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityEffects {
    /// `sizeof(AsperityEffects)`.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// The effect of a kind (the pointer from the plugin); NULL for a kind that is no effect. It stays valid
    /// for the life of the process. Control thread.
    pub effect: Option<unsafe extern "C" fn(kind: *const AsperityKind) -> *const AsperityEffect>,
}

/// An effect. The node renders it for many surfaces. Surfaces with the same settings share a slot. The
/// input `slot` picks one; 0 is the first. A value below 0, beyond the last or not a number picks none.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityEffect {
    /// `sizeof(AsperityEffect)`.
    pub size: u32,
    /// Where it acts: [`ASPERITY_TOUCHING`] and so on.
    pub acts: u32,
    /// Name of the parameter (a list of texts) with the settings of each slot.
    pub list: *const c_char,
    /// Number of forms.
    pub form_count: u32,
    /// Number of needs.
    pub need_count: u32,
    /// Ways to write the settings; the first is the usual one.
    pub forms: *const AsperityForm,
    /// Quantities of the contact that a scene connects to inputs.
    pub needs: *const AsperityNeed,
    /// Direction of the force: [`ASPERITY_NORMAL`] and so on; 0 for an effect without `law`.
    pub direction: u32,
    /// 0.
    pub reserved: u32,
    /// Law of the force for some settings and a normal force in N. It tells a scene whether the device
    /// bears the effect. NULL for an effect without a force. Control thread.
    pub law: Option<
        unsafe extern "C" fn(
            kind: *const AsperityKind,
            settings: *const AsperitySettings,
            normal_force_n: f64,
            law: *mut AsperityLaw,
        ) -> i32,
    >,
    /// Checks settings beyond the ranges of their fields. The index in `error` is that of a field.
    /// Optional. Control thread.
    pub check: Option<
        unsafe extern "C" fn(
            kind: *const AsperityKind,
            settings: *const AsperitySettings,
            error: *mut AsperityError,
        ) -> i32,
    >,
}

/// One way to write the settings of an effect: `name(field: value, ...)`. Arrays of these advance by the
/// first one's `size`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityForm {
    /// `sizeof(AsperityForm)`.
    pub size: u32,
    /// Number of fields.
    pub field_count: u32,
    /// The word before the parenthesis; empty for the only form of an effect.
    pub name: *const c_char,
    /// Fields.
    pub fields: *const AsperityParam,
    /// A text of this form, such as `(stiffness_n_per_mm: 0.2)`.
    pub example: *const c_char,
}

/// A quantity of the contact that a scene connects to an input. Arrays of these advance by the first
/// one's `size`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityNeed {
    /// `sizeof(AsperityNeed)`.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// Name of the input.
    pub input: *const c_char,
    /// Name of the quantity: an output of the kind `contact` or `velocity`.
    pub quantity: *const c_char,
}

/// Settings of an effect. Arrays of these advance by the first one's `size`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperitySettings {
    /// `sizeof(AsperitySettings)`.
    pub size: u32,
    /// Index of the form.
    pub form: u32,
    /// Values of the form's fields, in its order.
    pub values: *const AsperityValue,
    /// Number of values.
    pub value_count: u32,
    /// 0.
    pub reserved: u32,
}

/// A slot of an effect. Arrays of these advance by the first one's `size`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperitySlot {
    /// `sizeof(AsperitySlot)`.
    pub size: u32,
    /// Number of settings: 1, or more for a texture of several parts.
    pub count: u32,
    /// Settings.
    pub settings: *const AsperitySettings,
}

/// A linear law of force F = K x + B v along one direction, as it is near the place where it is steepest.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct AsperityLaw {
    /// `sizeof(AsperityLaw)`.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// Stiffness K in N/mm, at least 0.
    pub stiffness_n_per_mm: f64,
    /// Damping B in N s/m, of either sign.
    pub damping_ns_per_m: f64,
}
