"""The hc command, the runner that starts and watches the nodes, reports."""
