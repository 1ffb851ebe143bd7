//! The part of the service's JSON that is used here.

use std::borrow::Cow;

use serde::Deserialize;

/// Longest valid distance of a device \[m\].
const FAR_M: f64 = 10.0;

#[derive(Deserialize)]
struct Report<'a> {
    #[serde(borrow, default)]
    inverse3: Vec<Entry<'a>>,
}

#[derive(Deserialize)]
struct Entry<'a> {
    #[serde(borrow)]
    device_id: Cow<'a, str>,
    state: Option<State>,
}

#[derive(Deserialize)]
struct State {
    cursor_position: Option<Vector>,
}

#[derive(Deserialize)]
struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

fn parse(text: &str) -> Result<Report<'_>, String> {
    serde_json::from_str(text).map_err(|e| {
        let start: String = text.chars().take(40).collect();
        format!("`{start}` is no report of the service: {e}")
    })
}

/// Ids of the devices in a report. Error: the fault in the text, for a person.
pub(super) fn devices(text: &str) -> Result<Vec<String>, String> {
    Ok(parse(text)?.inverse3.into_iter().map(|d| d.device_id.into_owned()).collect())
}

/// Position of a device in mm, in its own axes; `None` where the report does not have the device. Error: the
/// fault in the text, for a person.
pub(super) fn position(text: &str, id: &str) -> Result<Option<[f64; 3]>, String> {
    let report = parse(text)?;
    let Some(entry) = report.inverse3.iter().find(|d| d.device_id == id) else { return Ok(None) };
    let at = entry.state.as_ref().and_then(|s| s.cursor_position.as_ref());
    let at = at.ok_or_else(|| format!("a report has no position of `{id}`"))?;
    let metres = [at.x, at.y, at.z];
    if metres.iter().any(|m| m.is_nan() || m.abs() > FAR_M) {
        return Err(format!("`{id}` cannot be at {metres:?} m"));
    }
    Ok(Some(metres.map(|m| m * 1e3)))
}

/// Command for a finite force \[N\] of a device, in its own axes.
pub(super) fn command(id: &str, force: [f64; 3]) -> String {
    let id = serde_json::Value::from(id);
    let [x, y, z] = force.map(|f| format!("{f:.6}"));
    let force = format!(r#"{{"set_cursor_force":{{"values":{{"x":{x},"y":{y},"z":{z}}}}}}}"#);
    format!(r#"{{"inverse3":[{{"device_id":{id},"commands":{force}}}]}}"#)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_is_json_with_the_force() {
        let json: serde_json::Value = serde_json::from_str(&command("04\"9D", [0.5, -1e-7, -2.25])).unwrap();
        let device = &json["inverse3"][0];
        assert_eq!(device["device_id"], "04\"9D");
        let values = &device["commands"]["set_cursor_force"]["values"];
        assert_eq!(
            (values["x"].as_f64(), values["y"].as_f64(), values["z"].as_f64()),
            (Some(0.5), Some(0.0), Some(-2.25))
        );
    }

    #[test]
    fn report_is_read_in_mm() {
        let text = r#"{"session_id":7,"inverse3":[{"device_id":"A","state":null},
            {"device_id":"049D","config":{"type":"inverse3","x":[1,2]},"status":{},
             "state":{"cursor_velocity":{"x":1,"y":1,"z":1},
                "cursor_position":{"x":0.01,"y":-0.12,"z":0.15}}}],"verse_grip":[]}"#;
        assert_eq!(position(text, "049D"), Ok(Some([10.0, -120.0, 150.0])));
        assert_eq!(position(text, "B"), Ok(None));
        assert!(position(text, "A").unwrap_err().contains("no position of `A`"));
        assert_eq!(devices(text).unwrap(), ["A", "049D"]);
        assert!(devices("{}").unwrap().is_empty());
    }

    #[test]
    fn invalid_report_error_says_why() {
        let far = r#"{"inverse3":[{"device_id":"A","state":{"cursor_position":{"x":0,"y":1e9,"z":0}}}]}"#;
        let null = r#"{"inverse3":[{"device_id":"A","state":{"cursor_position":{"x":0,"y":null,"z":0}}}]}"#;
        for (text, why) in [
            ("hello", "`hello` is no report"),
            ("", "is no report"),
            ("[1,2]", "is no report"),
            (r#"{"inverse3":3}"#, "is no report"),
            (null, "is no report"),
            (far, "cannot be at"),
        ] {
            assert!(position(text, "A").unwrap_err().contains(why), "{text}");
        }
        let deep = "[".repeat(100_000);
        assert!(position(&deep, "A").is_err());
    }
}
