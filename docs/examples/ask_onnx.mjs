// Ask an exported network from Node, without Python: docs/robot-software.md.
//
//   npm install onnxruntime-web
//   node ask_onnx.mjs universal.onnx universal.json home.json microwave
//
// onnxruntime-web computes in WebAssembly, in a browser too; onnxruntime-node is the same in code.
// A browser cannot read a file's metadata by it, so they lie beside the file, as JSON.

import { readFileSync } from "node:fs";
import * as ort from "onnxruntime-web";

const [model, metadata, graph, thing] = process.argv.slice(2);
if (thing === undefined) {
  console.error("usage: node ask_onnx.mjs MODEL.onnx METADATA.json GRAPH.json THING");
  process.exit(2);
}
const { classes, vocabulary, labels, words } = JSON.parse(readFileSync(metadata, "utf8"));
const meaning = (word) => words[word.toLowerCase()] ?? word;
const column = classes.indexOf(meaning(thing));
if (column < 0) {
  console.error(`${thing}: not among the file's classes, which are ${classes.join(", ")}`);
  process.exit(1);
}
const { rooms, objects } = JSON.parse(readFileSync(graph, "utf8"));

const nodes = rooms.length + 1; // the building itself is row 0
const row = new Map(rooms.map((room, number) => [room.id, number + 1]));
const table = (columns) => new Float32Array(nodes * columns.length);
const seen = table(classes), others = table(vocabulary), types = table(labels);
for (const { room, category } of objects) {
  const word = meaning(category);
  const [counts, columns] = classes.includes(word) ? [seen, classes] : [others, vocabulary];
  if (columns.includes(word))
    for (const node of [0, row.get(room)]) counts[node * columns.length + columns.indexOf(word)] += 1;
  else console.error(`${category}: the file does not know the word, so it is not read`);
}
rooms.forEach((room, number) => {
  if (labels.includes(room.room_type)) types[(number + 1) * labels.length + labels.indexOf(room.room_type)] = 1;
});
const visited = rooms.map((room) => Number(room.visited ?? true));
const hidden = rooms.map((room, number) => room.hidden_share ?? (visited[number] ? 0.5 : 1));
const mean = hidden.reduce((sum, share) => sum + share, 0) / rooms.length;

const floats = (values, ...shape) => new ort.Tensor("float32", Float32Array.from(values), shape);
const unknown = () => new ort.Tensor("int64", BigInt64Array.of(-1n), [1]);
const session = await ort.InferenceSession.create(readFileSync(model));
const { presence } = await session.run({
  seen: floats(seen, nodes, classes.length),
  others: floats(others, nodes, vocabulary.length),
  hidden_share: floats([mean, ...hidden], nodes),
  visited: floats([1, ...visited], nodes),
  withheld: floats(table(classes), nodes, classes.length),
  floor_area: floats(new Float32Array(nodes), nodes),
  labels: floats(types, nodes, labels.length),
  building_kind: unknown(),
  source: unknown(),
});
const answer = rooms.map((room, number) => [room.id, presence.data[(number + 1) * classes.length + column]]);
console.log(JSON.stringify(Object.fromEntries(answer)));
