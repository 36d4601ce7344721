import { beforeEach, expect, test } from "vitest";
import { connectionWords } from "../src/app/connectionWords";
import { bake, coming } from "../src/state/bakes";
import { connection, offline, refusedBecause, retryInMs } from "../src/state/connection";

beforeEach(() => {
  connection.value = "connecting";
  bake.value = coming.value = refusedBecause.value = null;
});

test("what was never baked waits for its bake, it does not connect", () => {
  coming.value = { id: "a" } as NonNullable<typeof coming.value>;
  expect(connectionWords()).toBe("Waiting for the bake");
  bake.value = "b";
  expect(connectionWords()).toBe("Connecting…");
});

test("a lost connection says that edits are kept and when it is tried again", () => {
  connection.value = "reconnecting";
  retryInMs.value = 4000;
  expect(connectionWords()).toBe("Connection lost. Edits are kept; trying again in 4 s");
});

test("silence says that edits are kept, and whether the browser is offline", () => {
  connection.value = "silent";
  expect(connectionWords()).toBe("No answer from the server. Edits are kept");
  offline.value = true;
  expect(connectionWords()).toBe("Offline. Edits are kept");
  offline.value = false;
});
