/** Requests the surface data of a pixel. */
import type { InspectAnswer } from "../protocol";
import { sendToShown } from "./connections";

const PROBE_TIMEOUT_MS = 3000;
const probeListeners = new Set<(answer: InspectAnswer) => void>();

/** Handle the server's response about a pixel. */
export function deliverProbe(answer: InspectAnswer): void {
  for (const onAnswer of probeListeners) onAnswer(answer);
}

/** The server's response for a pixel of a shown view. The server answers only the newest request, so a response for
 * another pixel triggers a retry. */
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
      reject(new Error("The server did not respond; try again."));
    }, PROBE_TIMEOUT_MS);
    probeListeners.add(onAnswer);
    sendRequest();
  });
}
