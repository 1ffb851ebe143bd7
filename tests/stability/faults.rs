//! Faults around a graph, and in it: a process that is killed, a disk that is full, a plugin that
//! does not come back, nodes that fail by chance.

mod chance;
mod disk;
mod full;
mod killed;
mod spin;
mod writers;

/// A test for each command that writes files.
macro_rules! each_writer {
    ($($test:ident $writer:literal),*) => {$(
        #[test]
        fn $test() {
            if disk::can_fail() {
                let writer = writers::WRITERS.iter().find(|w| w.name == $writer).expect("a writer");
                let found = full::endures(writer).and_then(|()| killed::endures(writer));
                assert_eq!(found, Ok(()));
            }
        }
    )*};
}

each_writer! {
    render_endures "render",
    inversion_endures "invert",
    comparison_endures "compare",
    picture_of_a_graph_endures "graph",
    expansion_endures "scene expand",
    fit_endures "fit-ar",
    library_that_is_added_to_endures "encode",
    new_plugin_endures "plugin new",
    calibration_endures "calibrate",
    run_endures "run",
    tradeoff_endures "tradeoff",
    merge_endures "tradeoff merge"
}
