//! The error that a plugin tells.

use std::ffi::{CStr, c_char};

use asperity_abi::{AsperityError, blank};
use asperity_node::{Diagnostic, Param, Params};

/// Buffers for a plugin's error message.
pub(crate) struct Said {
    pub(crate) abi: AsperityError,
    message: Vec<u8>,
    help: Vec<u8>,
}

impl Said {
    pub(crate) fn new() -> Self {
        let (mut message, mut help) = (vec![0; 1024], vec![0; 1024]);
        let abi = AsperityError {
            param: -1,
            message_capacity: message.len() as u32,
            help_capacity: help.len() as u32,
            message: message.as_mut_ptr().cast::<c_char>(),
            help: help.as_mut_ptr().cast::<c_char>(),
            ..blank()
        };
        Self { abi, message, help }
    }

    /// The error. It points at the parameter that the plugin names, of those in `of`.
    pub(crate) fn diagnostic(&self, params: &Params, of: &[Param], otherwise: &str) -> Diagnostic {
        let message = match said(&self.message) {
            message if message.is_empty() => otherwise.to_owned(),
            message => message,
        };
        let param = usize::try_from(self.abi.param).ok().and_then(|i| of.get(i));
        let d = params.error(param.map_or("", |p| &p.name), message);
        match said(&self.help) {
            help if help.is_empty() => d,
            help => d.help(help),
        }
    }
}

fn said(bytes: &[u8]) -> String {
    CStr::from_bytes_until_nul(bytes).map_or_else(
        |_| String::from_utf8_lossy(bytes).into_owned(),
        |text| text.to_string_lossy().into_owned(),
    )
}
