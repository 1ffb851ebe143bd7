//! Maps a file's axes to the world's.

use asperity_diagnostics::Diagnostic;

/// Maps the axes of a recording device to x, y, z with z up.
///
/// Written as three file axes, for x, y, z in this order, each with an optional minus sign. `x,y,z`
/// changes nothing. `x,-z,y` is for a device whose y is up and whose z points at the user: a rotation,
/// so left stays left. `x,z,y` exchanges y and z and so mirrors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisMap {
    source: [usize; 3],
    sign: [f64; 3],
}

impl Default for AxisMap {
    fn default() -> Self {
        Self { source: [0, 1, 2], sign: [1.0; 3] }
    }
}

impl AxisMap {
    /// Parses a text such as `x,-z,y`. Spaces and capitals do not matter. Error: anything but `x`, `y`, `z`,
    /// each once and with at most one sign. The error has no place; the caller knows it.
    pub fn parse(text: &str) -> Result<Self, Diagnostic> {
        let fail = |message: String| {
            Err(Diagnostic::new(message).help(
                "name the file's axis for each of x, y, z in this order, each once: `x,y,z`, or `x,-z,y` \
                 where the file's y is up",
            ))
        };
        let mut map = Self::default();
        let mut seen = [false; 3];
        let parts: Vec<&str> = text.split(',').map(str::trim).collect();
        if parts.len() != 3 {
            return fail(format!("an axis map has three axes; `{text}` has {}", parts.len()));
        }
        for (out, part) in parts.into_iter().enumerate() {
            let (sign, name) = match part.strip_prefix('-') {
                Some(rest) => (-1.0, rest.trim_start()),
                None => (1.0, part.strip_prefix('+').unwrap_or(part).trim_start()),
            };
            let axis = match name {
                "x" | "X" => 0,
                "y" | "Y" => 1,
                "z" | "Z" => 2,
                _ => return fail(format!("`{part}` is not an axis")),
            };
            if std::mem::replace(&mut seen[axis], true) {
                return fail(format!("the axis `{name}` is used twice in `{text}`"));
            }
            map.source[out] = axis;
            map.sign[out] = sign;
        }
        Ok(map)
    }

    /// The file's position in the world's axes.
    pub fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        // + 0.0 turns -0 into 0.
        [0, 1, 2].map(|out| self.sign[out] * p[self.source[out]] + 0.0)
    }

    /// The world's vector in the file's axes: the inverse of [`apply`](Self::apply).
    pub fn back(&self, world: [f64; 3]) -> [f64; 3] {
        let mut p = [0.0; 3];
        for out in 0..3 {
            p[self.source[out]] = self.sign[out] * world[out] + 0.0;
        }
        p
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_output_axis_takes_the_named_file_axis() {
        assert_eq!(AxisMap::parse("x,y,z").unwrap(), AxisMap::default());
        assert_eq!(AxisMap::parse("x,-z,y").unwrap().apply([1.0, 2.0, 3.0]), [1.0, -3.0, 2.0]);
        assert_eq!(AxisMap::parse(" Z , +x,- y").unwrap().apply([1.0, 2.0, 3.0]), [3.0, 1.0, -2.0]);
    }

    #[test]
    fn back_undoes_every_map() {
        for axes in ["x,y,z", "z,x,y", "-y,x,z", "x,-z,y", "-z,-y,-x"] {
            let map = AxisMap::parse(axes).unwrap();
            assert_eq!(map.back(map.apply([0.3, -1.2, 2.5])), [0.3, -1.2, 2.5], "{axes}");
        }
        // A force up is along the y of a device whose y is up.
        assert_eq!(AxisMap::parse("x,-z,y").unwrap().back([0.0, 0.0, 2.0]), [0.0, 2.0, 0.0]);
    }

    #[test]
    fn a_wrong_map_says_what_is_wrong() {
        for (text, what) in [
            ("", "has 1"),
            ("x,y", "has 2"),
            ("x,y,z,x", "has 4"),
            ("x,y,w", "`w` is not an axis"),
            ("x,y,", "`` is not an axis"),
            ("x,y,--z", "`--z` is not an axis"),
            ("x,-x,z", "`x` is used twice"),
        ] {
            let e = AxisMap::parse(text).unwrap_err();
            assert!(e.message.contains(what), "{text}: {e}");
            assert!(e.help.is_some_and(|h| h.contains("x,-z,y")));
        }
    }
}
