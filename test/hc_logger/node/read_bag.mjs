// Reads an MCAP file with @mcap/core and prints one JSON line for each message, with every field
// decoded by the schema that the file carries, after one line for the channels.
import { readFile } from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import * as fzstd from "fzstd";

const file = await readFile(process.argv[2]);
const reader = await McapIndexedReader.Initialize({
  readable: {
    size: async () => BigInt(file.length),
    read: async (offset, length) =>
      new Uint8Array(file.buffer, file.byteOffset + Number(offset), Number(length)),
  },
  decompressHandlers: {
    zstd: (data, size) => fzstd.decompress(data, new Uint8Array(Number(size))),
  },
});

const decoders = new Map();
const channels = {};
for (const channel of reader.channelsById.values()) {
  const schema = reader.schemasById.get(channel.schemaId);
  const definitions = parse(new TextDecoder().decode(schema.data), { ros2: true });
  decoders.set(channel.id, new MessageReader(definitions));
  channels[channel.topic] = {
    type: schema.name,
    hash: channel.metadata.get("topic_type_hash"),
    qos: channel.metadata.get("offered_qos_profiles"),
  };
}
const plain = (_key, value) =>
  typeof value === "bigint" ? value.toString() : ArrayBuffer.isView(value) ? [...value] : value;
const lines = [JSON.stringify({ profile: reader.header.profile, channels })];
for await (const message of reader.readMessages()) {
  const content = decoders.get(message.channelId).readMessage(message.data);
  const topic = reader.channelsById.get(message.channelId).topic;
  lines.push(JSON.stringify({ topic, time: message.logTime, content }, plain));
}
console.log(lines.join("\n"));
