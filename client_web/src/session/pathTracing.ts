/** Asks the server for the first surface on a path of the camera. */
import type { PathAnswer, Triple } from "../protocol";
import { connections } from "./connections";

const TIMEOUT_MS = 3000;
let lastId = 0;
const listeners = new Map<number, (answer: PathAnswer) => void>();

/** Handle the server's answer. */
export function deliverPath(answer: PathAnswer): void {
  listeners.get(answer.id)?.(answer);
}

/** The first surface on a path in the shown bake; rejects without a connection. */
export function tracePath(points: readonly Triple[]): Promise<PathAnswer> {
  return new Promise((resolve, reject) => {
    const id = ++lastId;
    const finish = (): void => {
      clearTimeout(timer);
      listeners.delete(id);
    };
    const timer = window.setTimeout(() => {
      finish();
      reject(new Error("The server did not respond; try again."));
    }, TIMEOUT_MS);
    listeners.set(id, (answer) => {
      finish();
      resolve(answer);
    });
    if (connections.shown?.session.send({ type: "path", id, points: [...points] }) === true) return;
    finish();
    reject(new Error("There is no connection to the server."));
  });
}
