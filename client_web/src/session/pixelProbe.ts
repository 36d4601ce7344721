/** Asking what a pixel shows. */
import type { InspectAnswer } from "../protocol";
import { sendToShown } from "./connections";

const PROBE_TIMEOUT_MS = 3000;
const probeListeners = new Set<(answer: InspectAnswer) => void>();

/** The server has said what a pixel is. */
export function deliverProbe(answer: InspectAnswer): void {
  for (const onAnswer of probeListeners) onAnswer(answer);
}

/** The server's answer for a pixel of a shown view. The newest request wins there, so another's answer requests again. */
export function requestPixelProbe(view: string, x: number, y: number): Promise<InspectAnswer> {
  return new Promise((resolve, reject) => {
    const finish = (): void => {
      clearTimeout(timer);
      probeListeners.delete(onAnswer);
    };
    const sendRequest = () => sendToShown({ type: "inspect", view, x, y });
    const onAnswer = (answer: InspectAnswer): void => {
      if (answer.view !== view || answer.x !== x || answer.y !== y) return void sendRequest();
      finish();
      resolve(answer);
    };
    const timer = window.setTimeout(() => {
      finish();
      reject(new Error("The server did not say what is there; try again."));
    }, PROBE_TIMEOUT_MS);
    probeListeners.add(onAnswer);
    sendRequest();
  });
}
