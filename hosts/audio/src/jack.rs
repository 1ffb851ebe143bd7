//! Facts of a JACK server that cpal does not tell.

use jack::{Client, ClientOptions, PortFlags};

use crate::find::Side;

/// Ports of the server's card on one side. JACK connects as many channels to them; the channels above lead
/// nowhere, though cpal offers 64. `None` if no server answers. Asks the server.
pub(crate) fn card_channels(side: Side) -> Option<u16> {
    let name = format!("asperity_look_{}", std::process::id());
    let (client, _) = Client::new(&name, ClientOptions::NO_START_SERVER).ok()?;
    // cpal looks for these names too.
    let ports = match side {
        Side::Output => "^system:playback_",
        Side::Input => "^system:capture_",
    };
    u16::try_from(client.ports(Some(ports), None, PortFlags::empty()).len()).ok()
}

/// Note on channels that the server's card does not have.
pub(crate) fn note(side: Side, highest: u16, card: u16) -> Option<String> {
    let ports = match side {
        Side::Output => "playback",
        Side::Input => "capture",
    };
    let count = if card == 1 { "1 port".to_owned() } else { format!("{card} ports") };
    (highest > card).then(|| {
        format!(
            "JACK offers 64 {} channels whatever is behind them; its card has {count} \
             (system:{ports}_N): channel {highest} leads nowhere unless something is patched to it",
            side.name()
        )
    })
}
