//! Families, the recognisable part of unknown surfaces.

use burn::tensor::activation::{log_softmax, softmax};
use burn::tensor::{Device, Int, Tensor, TensorData};

/// Classes by family.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Kin {
    /// Number of each class's family.
    of: Vec<usize>,
    families: usize,
}

/// Least probability of a family, so its logarithm is finite.
const LEAST: f32 = 1e-6;

impl Kin {
    /// From each class's family; none if a family is missing or there is only one.
    pub(crate) fn of<'a>(families: impl Iterator<Item = Option<&'a str>>) -> Option<Self> {
        let mut names: Vec<&str> = Vec::new();
        let number = |family: Option<&'a str>| -> Option<usize> {
            let family = family?;
            let known = names.iter().position(|name| *name == family);
            Some(known.unwrap_or_else(|| {
                names.push(family);
                names.len() - 1
            }))
        };
        let of = families.map(number).collect::<Option<Vec<_>>>()?;
        (names.len() > 1).then_some(Self { of, families: names.len() })
    }

    /// Minus the logarithm of the probability by scores \[n, classes\] of the right class's whole
    /// family.
    pub(super) fn loss(&self, scores: Tensor<2>, classes: &[usize], device: &Device) -> Tensor<1> {
        let belongs =
            self.of.iter().flat_map(|of| (0..self.families).map(move |f| f32::from(u8::from(f == *of))));
        let belongs = TensorData::new(belongs.collect::<Vec<f32>>(), [self.of.len(), self.families]);
        let parts = softmax(scores, 1).matmul(Tensor::from_data(belongs, device));
        let families: Vec<usize> = classes.iter().map(|class| self.of[*class]).collect();
        (parts + LEAST).log().gather(1, numbers(&families, device)).mean().neg()
    }
}

/// Minus the logarithm of the right class's probability by scores \[n, classes\].
pub(super) fn naming_loss(scores: Tensor<2>, classes: &[usize], device: &Device) -> Tensor<1> {
    log_softmax(scores, 1).gather(1, numbers(classes, device)).mean().neg()
}

fn numbers(all: &[usize], device: &Device) -> Tensor<2, Int> {
    let all: Vec<i32> = all.iter().map(|n| *n as i32).collect();
    let rows = all.len();
    Tensor::from_data(TensorData::new(all, [rows, 1]), device)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_family_has_the_parts_of_all_its_classes() {
        let device = Device::flex();
        let kin = Kin { of: vec![0, 1, 0], families: 2 };
        let parts = [0.5_f32, 0.3, 0.2];
        let scores = || Tensor::from_data(TensorData::new(parts.map(f32::ln).to_vec(), [1, 3]), &device);
        for (class, part) in [(0, 0.7_f32), (1, 0.3), (2, 0.7)] {
            let loss = kin.loss(scores(), &[class], &device).into_scalar::<f32>();
            assert!((loss + part.ln()).abs() < 1e-4, "{class}: {loss}");
            let loss = naming_loss(scores(), &[class], &device).into_scalar::<f32>();
            assert!((loss + parts[class].ln()).abs() < 1e-5, "{class}: {loss}");
        }
    }

    #[test]
    fn kin_needs_all_families_known_and_more_than_one() {
        let of = |families: &[Option<&'static str>]| Kin::of(families.iter().copied());
        assert_eq!(of(&[Some("a"), Some("b"), Some("a")]), Some(Kin { of: vec![0, 1, 0], families: 2 }));
        assert_eq!(of(&[Some("a"), None]), None);
        assert_eq!(of(&[Some("a"), Some("a")]), None);
    }
}
