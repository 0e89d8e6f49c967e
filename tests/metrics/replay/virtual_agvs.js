// Two virtual robots of `vda-5050-lib` (Siemens) and a fleet manager that sends them towards each other,
// so that they meet also if the second sets out late.
// Arguments: the broker's port, and the seconds after which it ends.
const { AgvController, MasterController, VirtualAgvAdapter } = require("vda-5050-lib");

const [port, seconds] = process.argv.slice(2).map(Number);
const client = { interfaceName: "uagv", transport: { brokerUrl: `mqtt://127.0.0.1:${port}` }, vdaVersion: "2.0.0" };
const WAYS = { east: [[-8, 0], [6, 0]], west: [[6, 0], [-8, 0]] };

async function drive(master, serialNumber, [from, to]) {
  const id = { manufacturer: "Siemens", serialNumber };
  const theta = Math.atan2(to[1] - from[1], to[0] - from[0]);
  const place = ([x, y]) => ({ x, y, mapId: "hall" });
  const robot = new AgvController(id, client, { agvAdapterType: VirtualAgvAdapter }, {
    initialPosition: { ...place(from), theta, lastNodeId: "a" }, vehicleSpeed: 1.5,
  });
  await robot.start();
  await master.assignOrder(id, {
    orderId: `order-${serialNumber}`,
    orderUpdateId: 0,
    nodes: [from, to].map((at, row) => ({
      nodeId: "ab"[row], sequenceId: 2 * row, released: true, nodePosition: { ...place(at), theta }, actions: [],
    })),
    edges: [{ edgeId: "ab", sequenceId: 1, startNodeId: "a", endNodeId: "b", released: true, maxSpeed: 1, actions: [] }],
  }, { onOrderProcessed: (error) => { if (error) { console.error(error); process.exit(1); } } });
}

async function main() {
  const master = new MasterController(client, {});
  await master.start();
  for (const [serialNumber, way] of Object.entries(WAYS)) await drive(master, serialNumber, way);
  setTimeout(() => process.exit(0), seconds * 1000);
}

main().catch((error) => { console.error(error); process.exit(1); });
