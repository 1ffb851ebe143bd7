//! The vector of a new material: a stored one, its own, or a blend.

use super::{Library, LibraryMaterial, VECTOR_LEN};

/// A material of a library and its distance from a vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbour<'l> {
    /// The material.
    pub material: &'l LibraryMaterial,
    /// Euclidean distance of the vectors.
    pub distance: f64,
}

/// Ways from a new material's own vector to the one for a texture network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Assignment {
    /// The nearest stored vector, as in Heravi et al. 2024. The network was trained on it.
    #[default]
    Nearest,
    /// Its own vector.
    Raw,
    /// The mean of this many nearest stored vectors, weighted by one over distance. Materials that
    /// share a vector count as one. 0 counts as 1; too many count as all.
    Blend(usize),
}

/// Default number of neighbours in a blend.
pub const BLENDED: usize = 3;

impl Library {
    /// The `n` materials nearest to a vector, nearest first. Ties keep the file's order.
    pub fn nearest(&self, vector: &[f32; VECTOR_LEN], n: usize) -> Vec<Neighbour<'_>> {
        let distance = |material: &LibraryMaterial| {
            let off = material.vector.iter().zip(vector).map(|(a, b)| f64::from(*a) - f64::from(*b));
            off.map(|x| x.powi(2)).sum::<f64>().sqrt()
        };
        let of = |material| Neighbour { material, distance: distance(material) };
        let mut all: Vec<_> = self.materials.iter().map(of).collect();
        all.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        all.truncate(n);
        all
    }

    /// The vector that a new material gets. A stored vector is never changed. In an empty library no
    /// vector is.
    pub fn assign(&self, vector: &[f32; VECTOR_LEN], how: Assignment) -> Box<[f32; VECTOR_LEN]> {
        let near = match how {
            Assignment::Raw => Vec::new(),
            Assignment::Nearest => self.nearest(vector, 1),
            Assignment::Blend(n) => {
                let mut all = self.nearest(vector, usize::MAX);
                all.dedup_by(|a, b| a.material.vector == b.material.vector);
                all.truncate(n.max(1));
                all
            }
        };
        match near.as_slice() {
            [] => Box::new(*vector),
            [first, rest @ ..] if rest.is_empty() || first.distance == 0.0 => first.material.vector.clone(),
            all => {
                let total: f64 = all.iter().map(|n| 1.0 / n.distance).sum();
                let mean = |i: usize| {
                    let part = |n: &Neighbour<'_>| f64::from(n.material.vector[i]) / n.distance;
                    (all.iter().map(part).sum::<f64>() / total) as f32
                };
                Box::new(std::array::from_fn(mean))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Materials on a line: the first number differs.
    fn line(places: &[f32]) -> Library {
        let material = |(i, x): (usize, &f32)| LibraryMaterial {
            vector: Box::new(at(*x)),
            ..super::super::tests::material(&format!("m{i}"))
        };
        Library::new("l.ron", None, places.iter().enumerate().map(material).collect())
    }

    fn at(x: f32) -> [f32; VECTOR_LEN] {
        let mut vector = [0.5; VECTOR_LEN];
        vector[0] = x;
        vector
    }

    #[test]
    fn neighbours_come_nearest_first_with_euclidean_distances() {
        let library = line(&[10.0, -1.0, 4.0, 1.0]);
        let mut vector = at(0.0);
        vector[255] = 3.5;
        let names: Vec<(&str, f64)> =
            library.nearest(&vector, 3).iter().map(|n| (n.material.name.as_str(), n.distance)).collect();
        // Ties keep the file's order.
        assert_eq!(names, [("m1", 10_f64.sqrt()), ("m3", 10_f64.sqrt()), ("m2", 5.0)]);
        assert_eq!(library.nearest(&vector, 9).len(), 4);
    }

    #[test]
    fn new_material_gets_nearest_own_or_blended_vector() {
        // Distances 4, 6 and 26. A repeated vector counts once.
        let two = (10.0 / 6.0) / (1.0 / 4.0 + 1.0 / 6.0);
        let three = (10.0 / 6.0 + 30.0 / 26.0) / (1.0 / 4.0 + 1.0 / 6.0 + 1.0 / 26.0);
        for library in [line(&[0.0, 10.0, 30.0]), line(&[0.0, 0.0, 10.0, 0.0, 10.0, 30.0])] {
            for (how, want) in [
                (Assignment::Nearest, 0.0),
                (Assignment::Raw, 4.0),
                (Assignment::Blend(0), 0.0),
                (Assignment::Blend(1), 0.0),
                (Assignment::Blend(2), two),
                (Assignment::Blend(3), three),
                (Assignment::Blend(99), three),
            ] {
                let found = library.assign(&at(4.0), how);
                assert!((f64::from(found[0]) - want).abs() < 1e-6, "{how:?}: {}", found[0]);
                assert_eq!(found[7], 0.5);
            }
        }
    }

    #[test]
    fn a_vector_that_is_stored_stays_what_it_is() {
        let library = line(&[0.0, 10.0, 10.0, 30.0]);
        for how in [Assignment::Nearest, Assignment::Raw, Assignment::Blend(3)] {
            assert_eq!(*library.assign(&at(10.0), how), at(10.0));
        }
    }
}
