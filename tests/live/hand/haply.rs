//! An Inverse3, played by a stand-in of the service.

use std::io::Write;
use std::net::TcpListener;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use asperity_hand::haply::start;
use asperity_hand::{ArmOptions, Handle};
use asperity_live::{SampleReader, force_model, samples};
use asperity_motion::AxisMap;
use asperity_node::Diagnostic;
use harness::alone::beside_others;
use harness::live::{Background, until};

use super::{floor, newest, problem};
use crate::haply::Service;

fn options(service: &Service) -> ArmOptions {
    ArmOptions { by: Some(service.address.to_string()), max_force_n: 3.0, ..ArmOptions::default() }
}

/// A hand at z = 0.
fn service(devices: &[&'static str]) -> Service {
    let service = Service::at("127.0.0.1:0".parse().unwrap(), devices);
    service.put([0.0; 3]);
    service
}

/// A service with a source that does not push.
fn listening() -> (Service, Handle, SampleReader) {
    let service = service(&["049D"]);
    let (to, from) = samples();
    let handle = start(options(&service), to, None).unwrap();
    (service, handle, from)
}

/// A hand that presses 4 mm into a floor of 0.5 N/mm.
fn pressing() -> (Service, Handle, SampleReader, Background) {
    let service = service(&["049D"]);
    service.put([0.0, 0.0, -0.004]);
    let (to, from) = samples();
    let (models, reader) = force_model();
    let held = floor(models);
    let handle = start(options(&service), to, Some(reader)).unwrap();
    until("the force", || service.last()[2] > 1.9);
    (service, handle, from, held)
}

fn refused(options: ArmOptions) -> Diagnostic {
    start(options, samples().0, None).unwrap_err()
}

#[test]
fn haply_hand_is_in_mm_and_floor_pushes_along_its_axis() {
    let _alone = beside_others();
    let service = service(&["049D"]);
    service.put([0.01, 0.02, -0.004]);
    let (to, mut from) = samples();
    let (models, reader) = force_model();
    let _floor = floor(models);
    let axes = AxisMap::parse("y,-x,z").unwrap();
    let handle = start(ArmOptions { axes, ..options(&service) }, to, Some(reader)).unwrap();
    let near = |f: f64, g: f64| (f - g).abs() < 1e-5;
    until("the force", || near(service.last()[2], 2.0));
    assert_eq!(service.last()[..2], [0.0, 0.0]);
    until("a sample", || {
        newest(&mut from).is_some_and(|s| {
            let off =
                s.position.iter().zip([20.0, -10.0, -4.0]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-9 && s.stroke == 0, "{s:?}");
            near(s.force, 2.0)
        })
    });
    service.put([0.01, 0.02, -0.12]);
    until("the greatest force", || near(service.last()[2], 3.0));
    service.put([0.01, 0.02, 0.01]);
    until("no force", || service.last() == [0.0; 3]);
    // In contact a dropped source lets go first, and says goodbye.
    service.put([0.01, 0.02, -0.004]);
    until("the force", || near(service.last()[2], 2.0));
    drop(handle);
    until("goodbye", || service.closed.load(Relaxed));
    let forces = service.forces.lock().unwrap();
    let last: Vec<_> = forces.iter().rev().take(12).map(|f| f[2]).collect();
    assert!(last[0] == 0.0 && last.windows(2).all(|w| w[1] >= w[0]), "{last:?}");
    assert!(last.iter().any(|f| *f > 0.05 && *f < 1.95), "it stepped: {last:?}");
}

#[test]
fn the_service_may_be_named_as_a_websocket_is() {
    let _alone = beside_others();
    let service = service(&["049D"]);
    for by in [format!("ws://{}", service.address), format!(" ws://{}/", service.address)] {
        let handle = start(ArmOptions { by: Some(by), ..options(&service) }, samples().0, None).unwrap();
        until("samples", || handle.samples() > 0);
    }
}

#[test]
fn killed_service_is_told_once_and_resumed_in_a_new_stroke() {
    let _alone = beside_others();
    let (service, handle, mut from) = listening();
    let address = service.address;
    until("samples", || newest(&mut from).is_some_and(|s| s.stroke == 0));
    drop(service);
    assert!(problem(&handle).contains("is lost"));
    std::thread::sleep(Duration::from_millis(600));
    assert_eq!(handle.problem(), None);
    newest(&mut from);
    let service = Service::at(address, &["049D", "AAAA"]);
    until("samples of a new stroke", || newest(&mut from).is_some_and(|s| s.stroke == 1));
    assert!(problem(&handle).contains("works again"));
    assert!(service.asked.load(Relaxed) > 0);
}

#[test]
fn unplugged_device_lets_go_and_goes_on_when_back() {
    let _alone = beside_others();
    let (service, handle, mut from, _floor) = pressing();
    service.devices.lock().unwrap().clear();
    assert!(problem(&handle).contains("`049D` is no longer there"));
    until("no force", || service.last() == [0.0; 3]);
    newest(&mut from);
    service.devices.lock().unwrap().push("049D");
    until("samples of a new stroke", || newest(&mut from).is_some_and(|s| s.stroke == 1));
    assert!(problem(&handle).contains("works again"));
}

#[test]
fn garbage_is_counted_and_lets_go() {
    let _alone = beside_others();
    let (service, handle, mut from, _floor) = pressing();
    *service.instead.lock().unwrap() = Some(r#"{"inverse3":"#.to_owned());
    until("bad messages", || handle.bad() > 10);
    assert!(handle.last_bad().unwrap().contains("is no report"));
    until("no force", || service.last() == [0.0; 3]);
    newest(&mut from);
    *service.instead.lock().unwrap() = None;
    until("the force again", || service.last()[2] > 1.9);
    assert!(newest(&mut from).is_some());
}

#[test]
fn a_service_that_falls_silent_is_told_and_connected_to_anew() {
    let _alone = beside_others();
    let (service, handle, mut from) = listening();
    until("samples", || newest(&mut from).is_some());
    service.silent.store(true, Relaxed);
    assert!(problem(&handle).contains("does not answer"));
    assert!(problem(&handle).contains("no answer for 1 s"));
    service.silent.store(false, Relaxed);
    until("samples of a new stroke", || newest(&mut from).is_some_and(|s| s.stroke >= 1));
}

#[test]
fn reports_that_nobody_asked_for_do_not_make_the_hand_lag() {
    let _alone = beside_others();
    let (service, handle, mut from) = listening();
    service.chatty.store(true, Relaxed);
    until("some", || handle.samples() > 300);
    // Each time it would lag; a machine that stalls lags now and then.
    let least = (1..=5).map(|n| {
        let place = 0.1 * f64::from(n);
        service.put([place, 0.0, 0.0]);
        let asked = service.asked.load(Relaxed);
        until("the new place", || {
            newest(&mut from).is_some_and(|s| (s.position[0] - 1000.0 * place).abs() < 1e-6)
        });
        service.asked.load(Relaxed) - asked
    });
    let least = least.min().unwrap();
    assert!(least < 100, "it took {least} questions");
}

#[test]
fn a_service_that_floods_does_not_hold_the_servo() {
    let _alone = beside_others();
    let (service, handle, _from) = listening();
    until("samples", || handle.samples() > 0);
    service.flood.store(true, Relaxed);
    until("it is told", || handle.problem().is_some_and(|p| p.contains("sends more than can be read")));
    drop(handle);
}

#[test]
fn what_is_missing_or_ambiguous_is_told_with_what_to_do() {
    let _alone = beside_others();
    let by = |address: &str| ArmOptions { by: Some(address.to_owned()), ..ArmOptions::default() };
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let e = refused(by(&free.to_string())).to_string();
    assert!(e.contains("no Haply Inverse Service answers at") && e.contains("Haply Hub"), "{e}");
    let e = refused(by("nowhere"));
    assert!(e.message.contains("answers at nowhere"), "{e}");

    // Something else listens there.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let other = listener.local_addr().unwrap();
    let web = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        stream.write_all(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nhi").unwrap();
        std::thread::sleep(Duration::from_millis(50));
    });
    let e = refused(by(&other.to_string()));
    assert!(e.message.contains("does not speak WebSocket"), "{e}");
    web.join().unwrap();

    assert!(refused(options(&service(&[]))).message.contains("knows no Inverse3"));
    let two = service(&["049D", "12AB"]);
    let e = refused(options(&two));
    assert!(e.message.contains("`049D`, `12AB`"), "{e}");
    let of = |id: &str| ArmOptions { device: Some(id.to_owned()), ..options(&two) };
    let e = refused(of("FFFF"));
    assert!(e.message.contains("`FFFF`") && e.help.as_ref().unwrap().contains("`049D`, `12AB`"), "{e}");
    start(of("12AB"), samples().0, None).unwrap();
}
