import { beforeEach, expect, test } from "vitest";
import { connectionMessage } from "../src/app/connectionMessages";
import { bake, pendingBake } from "../src/state/bakes";
import { connection, isOffline, rejectionMessage, retryInMs } from "../src/state/connection";

beforeEach(() => {
  connection.value = "connecting";
  bake.value = pendingBake.value = rejectionMessage.value = null;
});

test("what was never baked waits for its bake, it does not connect", () => {
  pendingBake.value = { id: "a" } as NonNullable<typeof pendingBake.value>;
  expect(connectionMessage()).toBe("Waiting for the bake");
  bake.value = "b";
  expect(connectionMessage()).toBe("Connecting…");
});

test("a lost connection says that edits are kept and when it is tried again", () => {
  connection.value = "reconnecting";
  retryInMs.value = 4000;
  expect(connectionMessage()).toBe("Connection lost. Your edits are safe; retrying in 4 s");
});

test("silence says that edits are kept, and whether the browser is offline", () => {
  connection.value = "silent";
  expect(connectionMessage()).toBe("The server does not respond. Your edits are safe");
  isOffline.value = true;
  expect(connectionMessage()).toBe("Offline. Your edits are safe");
  isOffline.value = false;
});
