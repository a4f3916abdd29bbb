"""The live page: a node that listens to the suite's topics and serves them to browsers.

Without ROS: digest (a thousand estimates a second to fifty rows), history (the last minutes of
rows), palpation (what was felt where), latency, security (who may look and who may change), viewers
(a bounded queue each), server (aiohttp, in a thread of its own), foxglove (the same data in the
Foxglove WebSocket protocol).
With ROS: taps (subscriptions that are emptied, not called back), feed (topics to digest),
controls (parameters, services, recording), node.
The page itself is in page/: no outside address, uPlot beside it with its licence.
"""
