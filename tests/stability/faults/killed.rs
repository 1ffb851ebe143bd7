//! Killed in mid-write: what was there is untouched, or the new file is whole; what else is left says what
//! it is, and harms nobody.

use super::disk::{Fails, JOURNAL, Place, can_fail, is_recognisable};
use super::writers::{Writer, mutant};

/// Of so many changes some at which the process is killed: the first, the last and some between.
fn picked(changes: u64, most: u64) -> Vec<u64> {
    let mut all: Vec<u64> = (0..most).map(|i| 1 + i * (changes.max(1) - 1) / (most - 1).max(1)).collect();
    all.dedup();
    all
}

/// Whether a command leaves nothing that is half wherever it is killed.
pub(super) fn endures(writer: &Writer) -> Result<(), String> {
    let undisturbed = Place::new(writer, true);
    let ended = undisturbed.run(writer, Fails::Never);
    let (Some(0), Some((changes, _))) = (ended.code, ended.wrote) else {
        return Err(format!("{}: it fails by itself: {}", writer.name, ended.said));
    };
    if let Some(made) =
        writer.makes.iter().find(|made| !(made.whole)(&undisturbed.dir.path().join(made.name)))
    {
        return Err(format!("{}: {} is never whole", writer.name, made.name));
    }
    for (i, at) in picked(changes, if writer.live { 3 } else { 6 }).into_iter().enumerate() {
        let place = Place::new(writer, i % 2 == 0);
        let before = place.now(writer);
        let ended = place.run(writer, Fails::KilledAt(at));
        let about =
            |what: String| Err(format!("{}, killed at change {at} of {changes}: {what}", writer.name));
        if !ended.killed && !writer.live {
            return about(format!("it was not: {}", ended.said));
        }
        if let Some(half) = place.half(writer, &before) {
            return about(half);
        }
        // The next run finishes what a journal lists.
        let journal = place.left(writer).iter().any(|name| name.ends_with(JOURNAL));
        if !writer.live && !journal && place.is_mixed(writer, &before) {
            return about("old and new files are mixed".into());
        }
        if let Some(odd) = place.left(writer).iter().find(|name| !is_recognisable(name, writer)) {
            return about(format!("nobody knows what {odd} is"));
        }
        // As if nothing had been. What is done already may be refused.
        let whole = || writer.makes.iter().all(|made| (made.whole)(&place.dir.path().join(made.name)));
        let done = whole();
        let again = place.run(writer, Fails::Never);
        if again.code != Some(0) && !done || !whole() {
            return about(format!("afterwards it does not do its work: {}", again.said));
        }
        let folder = writer.makes.iter().any(|made| made.folder);
        if let Some(left) = place.left(writer).iter().find(|name| !folder && name.contains(".part")) {
            return about(format!("{left} stays for ever"));
        }
    }
    Ok(())
}

/// Mutants: one that writes in place, one whose leftovers nobody knows, one that such a leftover stops for
/// good.
#[test]
fn writers_that_a_kill_harms_are_found_out() {
    if !can_fail() {
        return;
    }
    for (line, says) in [
        ("exec dd if=new of=out bs=64", "out is half"),
        ("dd if=new of=t bs=64 && mv t out", "nobody knows what t is"),
        ("set -C; dd if=new bs=64 > .out.1.part && mv .out.1.part out", "does not do its work"),
    ] {
        let found = endures(&mutant(line)).unwrap_err();
        assert!(found.contains(says), "{found}");
    }
    endures(&mutant("dd if=new of=.out.1.part bs=64 && mv .out.1.part out")).unwrap();
}
