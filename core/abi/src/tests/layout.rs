//! Version 1.0 in bytes: a plugin that was built yesterday must be read today.
#![cfg(target_pointer_width = "64")]

use std::mem::{offset_of, size_of};

use crate::*;

#[test]
fn version_1_keeps_its_layout() {
    macro_rules! sizes {
        ($($t:ident: $bytes:literal),* $(,)?) => {
            $(assert_eq!(size_of::<$t>(), $bytes, stringify!($t));)*
        };
    }
    sizes! {
        AsperityEntry: 24,
        AsperityHost: 32,
        AsperityPlugin: 40,
        AsperityRandom: 16,
        AsperityFacts: 16,
        AsperityFactSink: 40,
        AsperityPort: 88,
        AsperityParam: 112,
        AsperityPortSink: 32,
        AsperityKind: 200,
        AsperityValue: 64,
        AsperityWire: 48,
        AsperityError: 32,
        AsperityInfo: 56,
        AsperityBuffer: 40,
        AsperityTick: 56,
        AsperityEffects: 16,
        AsperityEffect: 64,
        AsperityForm: 32,
        AsperityNeed: 24,
        AsperitySettings: 24,
        AsperitySlot: 16,
        AsperityLaw: 24,
    }
    // Version 1.1 added `slots`.
    assert_eq!(AsperitySetup::SIZE_1_0, 72);
    assert_eq!(offset_of!(AsperityEntry, open), 16);
    assert_eq!(offset_of!(AsperityKind, process), 120);
    assert_eq!(offset_of!(AsperityKind, destroy), 192);
    assert_eq!(offset_of!(AsperityTick, detail), 48);
    assert_eq!(offset_of!(AsperityBuffer, data), 32);
    assert_eq!(ASPERITY_MAGIC.to_le_bytes(), *b"ASPERITY");
}
