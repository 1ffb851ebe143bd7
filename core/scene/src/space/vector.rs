//! Sums and products of three numbers.

pub(crate) type Vector = [f64; 3];

pub(super) fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn scaled(a: Vector, by: f64) -> Vector {
    [a[0] * by, a[1] * by, a[2] * by]
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// Unit vector and the length of the original. A vector without length gives z.
pub(super) fn unit(a: Vector) -> (Vector, f64) {
    let length = norm(a);
    if length > 0.0 { (scaled(a, 1.0 / length), length) } else { ([0.0, 0.0, 1.0], 0.0) }
}

/// Lesser of two numbers. `f64::min` also checks for NaN, which takes as long again.
pub(super) fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// Greater of two numbers.
pub(super) fn most(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Two directions at right angles to `normal` and to each other, right-handed with it. They are x and y,
/// turned as z is turned the shortest way to `normal` (Frisvad 2012, "Building an orthonormal basis from
/// a 3D unit vector without normalization"). `normal` must not be -z.
pub(super) fn tangents(normal: Vector) -> [Vector; 2] {
    let [x, y, z] = normal;
    let c = 1.0 / (1.0 + z);
    [[1.0 - x * x * c, -x * y * c, -x], [-x * y * c, 1.0 - y * y * c, -y]]
}
