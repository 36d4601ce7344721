/** Asking what a pixel shows. */
import type { ProbeAnswer } from "../protocol";
import { send } from "./connections";

const ANSWERED_WITHIN_MS = 3000;
const waiting = new Set<(answer: ProbeAnswer) => void>();

/** The server has said what a pixel is. */
export function answered(answer: ProbeAnswer): void {
  for (const take of waiting) take(answer);
}

/** What the server says of a pixel of a shown view. The newest question wins there, so another's answer asks again. */
export function askProbe(view: string, x: number, y: number): Promise<ProbeAnswer> {
  return new Promise((resolve, reject) => {
    const end = (): void => {
      clearTimeout(timer);
      waiting.delete(take);
    };
    const ask = () => send({ type: "probe", view, x, y });
    const take = (answer: ProbeAnswer): void => {
      if (answer.view !== view || answer.x !== x || answer.y !== y) return void ask();
      end();
      resolve(answer);
    };
    const timer = window.setTimeout(() => {
      end();
      reject(new Error("The server did not say what is there; try again."));
    }, ANSWERED_WITHIN_MS);
    waiting.add(take);
    ask();
  });
}
