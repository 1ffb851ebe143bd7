//! The card that is written beside a model.

use crate::arguments::Settings;
use crate::data::Data;
use crate::evaluation::Evaluation;

pub(crate) fn write(_settings: &Settings, _data: &Data, evaluation: &Evaluation) -> String {
    format!("{evaluation:#?}")
}
