"""The ROS side of the estimator node, one part a file.

Modules: settings (declared parameters, their validation), outputs (publishers and messages),
inputs (subscriptions), status (diagnostics), lifecycle. The node itself is hc_estimator.node.
"""
