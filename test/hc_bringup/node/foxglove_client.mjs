// Connects as Foxglove does, with its own client, subscribes to one topic, decodes every message by
// the definition that the server tells, and prints them as JSON lines until its input is closed.
// Usage: node foxglove_client.mjs ADDRESS SUBPROTOCOL TOPIC
import protocol from "@foxglove/ws-protocol";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import WebSocket from "ws";

const [address, subprotocol, topic] = process.argv.slice(2);
const client = new protocol.FoxgloveClient({ ws: new WebSocket(address, [subprotocol]) });
const readers = new Map();
const plain = (_key, value) =>
  typeof value === "bigint" ? value.toString() : ArrayBuffer.isView(value) ? [...value] : value;
const say = (line) => process.stdout.write(JSON.stringify(line, plain) + "\n");

client.on("error", (error) => {
  say({ error: String(error.message || error) });
  process.exit(3);
});
client.on("serverInfo", (info) => say({ info }));
client.on("status", (status) => say({ status }));
client.on("advertise", (channels) => {
  for (const channel of channels) {
    say({ channel: channel.topic, type: channel.schemaName, encoding: channel.encoding });
    if (channel.topic !== topic) continue;
    const reader = new MessageReader(parse(channel.schema, { ros2: true }));
    readers.set(client.subscribe(channel.id), reader);
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  say({ timestamp, message: readers.get(subscriptionId).readMessage(data) });
});
process.stdin.on("end", () => process.exit(0)).resume();
