//! The graph file: read, checked, compiled to a schedule.
