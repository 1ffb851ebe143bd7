//! Files made from others: the same from the same seed, everywhere.

use asperity_node::random;

/// Texts that replace numbers.
const NUMBERS: [&str; 18] = [
    "1e308",
    "-1e308",
    "1e-320",
    "1e400",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551616",
    "4294967295",
    "2147483648",
    "268435456",
    "65536",
    "1000000",
    "NaN",
    "-inf",
    "-0",
    "0",
    "-1",
    "",
];

/// Random numbers of a seed, one after the other.
struct Dice {
    seed: u64,
    thrown: u64,
}

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.thrown += 1;
        ((random::uniform(self.seed, self.thrown) * n as f64) as usize).min(n.saturating_sub(1))
    }

    /// A part of something of this length, no longer than `most`.
    fn part(&mut self, len: usize, most: usize) -> std::ops::Range<usize> {
        let from = self.below(len + 1);
        from..from + self.below((len - from).min(most) + 1)
    }
}

/// One of some files with one to four changes: bits and bytes turned over, parts cut off, left out, doubled,
/// taken from another file, numbers that are out of all proportion.
pub(super) fn bent(whole: &[Vec<u8>], seed: u64) -> Vec<u8> {
    let mut dice = Dice { seed: seed.wrapping_add(1), thrown: 0 };
    let mut file = whole[dice.below(whole.len())].clone();
    for _ in 0..1 + dice.below(4) {
        let at = dice.below(file.len());
        match dice.below(9) {
            0 if !file.is_empty() => file[at] ^= 1 << dice.below(8),
            1 if !file.is_empty() => file[at] = dice.below(256) as u8,
            2 => file.truncate(at),
            3 => drop(file.drain(dice.part(file.len(), 64))),
            4 => {
                let part = file[dice.part(file.len(), 256)].to_vec();
                file.splice(at..at, part);
            }
            5 => {
                let other = &whole[dice.below(whole.len())];
                let part = other[dice.part(other.len(), 256)].to_vec();
                file.splice(at..at, part);
            }
            6 => {
                let wide = [2, 4, 8][dice.below(3)];
                let end = (at + wide).min(file.len());
                file[at..end].fill([0, 0xff, 0x7f, 0x80][dice.below(4)]);
            }
            _ => number(&mut file, &mut dice),
        }
    }
    file
}

/// Puts another number in the place of one.
fn number(file: &mut Vec<u8>, dice: &mut Dice) {
    let digit = |b: &u8| b.is_ascii_digit() || matches!(b, b'.' | b'-');
    let at = dice.below(file.len());
    let Some(begin) = file[at..].iter().position(|b| b.is_ascii_digit()).map(|i| at + i) else { return };
    let end = file[begin..].iter().position(|b| !digit(b)).map_or(file.len(), |i| begin + i);
    file.splice(begin..end, NUMBERS[dice.below(NUMBERS.len())].bytes());
}

#[test]
fn the_same_seed_makes_the_same_file_and_most_files_are_others() {
    let whole = vec![b"t_s,x_mm\n0,1.5\n".to_vec(), b"0.25".to_vec()];
    let all: Vec<_> = (0..200).map(|seed| bent(&whole, seed)).collect();
    assert_eq!(all, (0..200).map(|seed| bent(&whole, seed)).collect::<Vec<_>>());
    let changed = all.iter().filter(|file| !whole.contains(file)).count();
    assert!(changed > 180, "{changed} of 200");
}
