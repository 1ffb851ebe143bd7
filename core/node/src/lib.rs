//! What a node is: ports, units, parameters, statuses.
