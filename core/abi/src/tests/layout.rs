//! Version 1.0 in bytes: a plugin that was built yesterday must be read today.
#![cfg(target_pointer_width = "64")]

use std::mem::{offset_of, size_of};

use crate::*;

#[test]
fn version_1_keeps_its_layout() {
    let sizes = [
        ("AsperityEntry", size_of::<AsperityEntry>(), 24),
        ("AsperityHost", size_of::<AsperityHost>(), 32),
        ("AsperityPlugin", size_of::<AsperityPlugin>(), 40),
        ("AsperityRandom", size_of::<AsperityRandom>(), 16),
        ("AsperityFacts", size_of::<AsperityFacts>(), 16),
        ("AsperityFactSink", size_of::<AsperityFactSink>(), 40),
        ("AsperityPort", size_of::<AsperityPort>(), 88),
        ("AsperityParam", size_of::<AsperityParam>(), 112),
        ("AsperityPortSink", size_of::<AsperityPortSink>(), 32),
        ("AsperityKind", size_of::<AsperityKind>(), 200),
        ("AsperityValue", size_of::<AsperityValue>(), 64),
        ("AsperityWire", size_of::<AsperityWire>(), 48),
        ("AsperitySetup up to `slots`, which 1.1 added", offset_of!(AsperitySetup, slots), 72),
        ("AsperityError", size_of::<AsperityError>(), 32),
        ("AsperityInfo", size_of::<AsperityInfo>(), 56),
        ("AsperityBuffer", size_of::<AsperityBuffer>(), 40),
        ("AsperityTick", size_of::<AsperityTick>(), 56),
        ("AsperityEffects", size_of::<AsperityEffects>(), 16),
        ("AsperityEffect", size_of::<AsperityEffect>(), 64),
        ("AsperityForm", size_of::<AsperityForm>(), 32),
        ("AsperityNeed", size_of::<AsperityNeed>(), 24),
        ("AsperitySettings", size_of::<AsperitySettings>(), 24),
        ("AsperitySlot", size_of::<AsperitySlot>(), 16),
        ("AsperityLaw", size_of::<AsperityLaw>(), 24),
    ];
    for (name, found, wanted) in sizes {
        assert_eq!(found, wanted, "{name}");
    }
    assert_eq!(offset_of!(AsperityEntry, open), 16);
    assert_eq!(offset_of!(AsperityKind, process), 120);
    assert_eq!(offset_of!(AsperityKind, destroy), 192);
    assert_eq!(offset_of!(AsperityTick, detail), 48);
    assert_eq!(offset_of!(AsperityBuffer, data), 32);
    assert_eq!(ASPERITY_MAGIC.to_le_bytes(), *b"ASPERITY");
}
