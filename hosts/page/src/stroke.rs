//! A stroke of a page as the CSV that `--input` reads.

use std::fmt::Write as _;

use asperity_live::view::Pointer;

use crate::map::Map;
use crate::wire::REACH_MM;

/// Time, x, y, pressure, and tilt to the right and away from the person.
const COLUMNS: usize = 6;
/// Most rows of a stroke, and its greatest length \[s\].
const ROWS: usize = 60_000;
const LONGEST_S: f64 = 120.0;
/// Most bytes of a stroke.
pub(crate) const BYTES: usize = 8 * COLUMNS * ROWS;
/// Longest time between two rows of the file \[s\]. A browser that was busy left more.
const GAP_S: f64 = 0.05;

/// Writes a stroke of numbers (f64, little-endian): `(t_s, x_mm, y_mm, pressure, tilt x, tilt y) ...`. Height
/// and force are those of a pointer over a map. `tilt`: writes the tilt too, where a pen has one.
pub(crate) fn csv(bytes: &[u8], pointer: &Pointer, map: Option<&Map>, tilt: bool) -> Result<String, String> {
    let rows = rows(bytes).ok_or("This is no stroke.")?;
    if rows.len() < 2 {
        return Err("The stroke is too short.".into());
    }
    let tilt = tilt && rows.iter().any(|[.., right, away]| [*right, *away] != [0.0; 2]);
    let write = |out: &mut String, [t, x, y, pressure, right, away]: [f64; COLUMNS]| {
        let above = if pressure > 0.0 { -pressure * pointer.depth_mm } else { pointer.lift_mm };
        let z = pointer.height_mm + above + map.map_or(0.0, |map| map.height_mm([x, y]));
        let force = pressure * pointer.max_force_n;
        // This cannot fail.
        let _ = write!(out, "{t},{x},{y},{z},{force}");
        let _ = if tilt { writeln!(out, ",{right},{away}") } else { writeln!(out) };
    };
    let mut out = format!("t_s,x_mm,y_mm,z_mm,force_n{}\n", if tilt { ",tilt_x_deg,tilt_y_deg" } else { "" });
    let mut before: Option<[f64; COLUMNS]> = None;
    for row in rows {
        if let Some(before) = before {
            let gap = row[0] - before[0];
            if gap <= 0.0 {
                return Err("The clock of the stroke stands still or goes back.".into());
            }
            let steps = (gap / GAP_S).ceil() as usize;
            for step in 1..steps {
                let part = step as f64 / steps as f64;
                write(&mut out, std::array::from_fn(|k| before[k] + part * (row[k] - before[k])));
            }
        }
        write(&mut out, row);
        before = Some(row);
    }
    Ok(out)
}

/// Reads the rows. `None` for anything that the page would not send.
fn rows(bytes: &[u8]) -> Option<Vec<[f64; COLUMNS]>> {
    let (eights, rest) = bytes.as_chunks::<8>();
    let numbers: Vec<f64> = eights.iter().map(|x| f64::from_le_bytes(*x)).collect();
    let (rows, more) = numbers.as_chunks::<COLUMNS>();
    let fits = |&[t, x, y, pressure, right, away]: &[f64; COLUMNS]| {
        (0.0..=LONGEST_S).contains(&t)
            && [x, y].iter().all(|v| v.abs() <= REACH_MM)
            && (0.0..=1.0).contains(&pressure)
            && [right, away].iter().all(|v| v.abs() <= 90.0)
    };
    (rest.is_empty() && more.is_empty() && rows.len() <= ROWS && rows.iter().all(fits)).then(|| rows.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTER: Pointer = Pointer { height_mm: 1.0, depth_mm: 4.0, lift_mm: 2.0, max_force_n: 3.0 };

    fn written(rows: &[[f64; COLUMNS]]) -> Result<String, String> {
        let bytes: Vec<u8> = rows.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        csv(&bytes, &POINTER, None, true)
    }

    #[test]
    fn stroke_is_written_with_height_force_and_tilt() {
        let text = written(&[[0.0, 1.0, -2.0, 0.5, 30.0, -12.5], [0.01, 1.5, -2.0, 0.0, 0.0, 0.0]]);
        let rows = "0,1,-2,-1,1.5,30,-12.5\n0.01,1.5,-2,3,0,0,0\n";
        assert_eq!(text.unwrap().split_once('\n').unwrap().1, rows);
        // A gap is filled on a straight line.
        let text = written(&[[0.0; COLUMNS], [0.1, 4.0, 0.0, 0.0, 0.0, 0.0]]).unwrap();
        assert_eq!(text.lines().nth(2), Some("0.05,2,0,3,0"));
    }

    #[test]
    fn strokes_that_no_page_sends_are_refused() {
        let good = [[0.0, 0.0, 0.0, 0.5, 0.0, 0.0], [0.01, 1.0, 0.0, 0.5, 0.0, 0.0]];
        assert!(written(&good).is_ok());
        for (column, value) in [
            (0, 121.0),
            (0, f64::NAN),
            (1, f64::INFINITY),
            (2, 1e9),
            (3, 1.1),
            (3, -0.1),
            (4, 91.0),
            (0, 0.0),
        ] {
            let mut bad = good;
            bad[1][column] = value;
            assert!(written(&bad).is_err(), "{column} {value}");
        }
        assert!(written(&good[..1]).is_err() && written(&[]).is_err());
        assert!(csv(&[0; 95], &POINTER, None, true).is_err());
        let many: Vec<_> = (0..=ROWS).map(|i| [i as f64 * 1e-3, 0.0, 0.0, 0.5, 0.0, 0.0]).collect();
        assert!(written(&many[1..]).is_ok() && written(&many).is_err());
    }
}
