/** Match: the user paints light over the image, and the server finds the lights, while the brush moves. The look is
 * previewed until the stroke ends, and is one step then. */
import { batch, effect, signal } from "@preact/signals";
import { cancelPreview, commitPreview, previewStep } from "../../../edit/edit";
import type { Look, Rgb, ShortfallBody, SolveBody, SolveRequest, StrokeBody } from "../../../protocol";
import { stage } from "../../../render/renderStage";
import { solveLook } from "../../../session/net/api";
import { LatestRequest } from "../../../session/net/latestRequest";
import { requestPixelProbe } from "../../../session/pixelProbe";
import { bake } from "../../../state/bakes";
import { changeByPatch } from "../../../state/document/jsonPatch";
import { jsonPointer } from "../../../state/document/pointer";
import { look } from "../../../state/look";
import { isMatchOpen, lockedPointers } from "../../../state/match";
import { activeViewName } from "../../../state/views";
import { reportErrors } from "../../../ui/toasts";
import { cameraOf } from "../../../viewport/cameras/freeCamera";

export type StrokeKind = StrokeBody["kind"];
export type ImagePoint = [x: number, y: number];

export const strokeKind = signal<StrokeKind>("brighter");
export const strokeStops = signal(1);
export const strokeColor = signal<Rgb>([1, 0.45, 0.2]);
/** Radius of the brush on the screen, pixels. */
export const brushRadius = signal(40);
export const changesColor = signal(true);
/** A reference picture: its file in base64. */
export const referencePicture = signal<{ name: string; image: string } | null>(null);
/** True if only the relative brightness of the reference picture counts. */
export const fitsExposure = signal(false);
/** True if the materials painted on may change, too, when a stroke ends. */
export const changesMaterials = signal(false);
/** True if the environment may rotate when the whole picture is matched. */
export const rotatesEnvironment = signal(false);
export const matchStatus = signal("");

const MAX_POINTS = 2000;
const MAX_PROBES = 8;
const HINT = "Paint over the picture. The lights follow. Esc: cancel.";
const PREPARING = "Preparing an image of each light…";
const SOLVING = "Finding the lights…";
const CAUSES: Record<ShortfallBody["cause"], string> = {
  locked: "the lights there are locked",
  no_light: "no light reaches it",
  conflict: "its lights also light other places, or have another color",
};

/** A stroke being painted, or a match of the whole picture. */
interface Gesture {
  label: string;
  view: string;
  /** The look when it began, to which it is relative. */
  before: Look;
  points: ImagePoint[];
  radius: number;
  isEnded: boolean;
}

/** The current stroke, which the brush draws. */
export const gesture = signal<Gesture | null>(null);

interface SolveInput {
  body: SolveRequest;
  gesture: Gesture | null;
  /** True for the request at the end of a stroke, whose answer makes it a step. */
  isFinal: boolean;
}

const requests = new LatestRequest(
  async (input: SolveInput) => ({ input, answer: await solveLook(input.body) }),
  ({ input, answer }) => showAnswer(input, answer),
  (error) => {
    stopGesture();
    matchStatus.value = (error as Error).message;
  },
);

function showAnswer(input: SolveInput, answer: SolveBody): void {
  if (!isMatchOpen.peek()) return;
  if (input.gesture === null) {
    if (gesture.peek() === null) matchStatus.value = HINT;
    return;
  }
  if (input.gesture !== gesture.peek()) return; // canceled
  previewStep(input.gesture.label, changeByPatch(input.gesture.before, answer.patch).after);
  matchStatus.value = resultText(answer);
  if (input.isFinal) {
    gesture.value = null;
    commitPreview();
  }
}

function formatStops(stops: number): string {
  return `${stops < 0 ? "−" : "+"}${Math.abs(stops).toFixed(1)} EV`;
}

function shortfallText({ asked_stops: asked, reached_stops: reached, cause }: ShortfallBody): string {
  const stops =
    asked == null || reached == null ? "" : ` (asked ${formatStops(asked)}, reached ${formatStops(reached)})`;
  return `Cannot be reached${stops}: ${CAUSES[cause]}.`;
}

/** The result of a match as text. */
export function resultText({ residual, changes, materials, shortfalls }: SolveBody): string {
  const lights = changes.length === 1 ? "1 light" : `${changes.length || "No"} lights`;
  const changed = [lights, ...materials].join(", ");
  return [`${changed} changed. Residual ${(100 * residual).toFixed(1)} %.`, ...shortfalls.map(shortfallText)].join(" ");
}

/** A request for the look before a gesture, without a target. */
function baseRequest(view: string, current: Look): SolveRequest | null {
  const [id, camera] = [bake.peek(), cameraOf(view)];
  if (id === null) return null;
  const { width, height } = stage.imageOf(view).pixels;
  const free = camera === null ? {} : { camera, size: [width, height] as [number, number] };
  const locked = [...lockedPointers.peek()].filter((pointer) => isLockable(current, pointer));
  return { bake: id, view, look: { ...current }, locked, ...free };
}

/** True for the environment and for lights that are on: others are no sources. */
function isLockable(current: Look, pointer: string): boolean {
  if (pointer === ENVIRONMENT_POINTER) return true;
  return Object.entries(current.lights).some(
    ([name, light]) => light.enabled && jsonPointer("lights", name) === pointer,
  );
}

export const ENVIRONMENT_POINTER = "/environment";

function referenceBody(): Pick<SolveRequest, "reference"> {
  const picture = referencePicture.peek();
  return picture === null ? {} : { reference: { image: picture.image, fit_exposure: fitsExposure.peek() } };
}

/** Materials under the points of a stroke; in free-camera views the server picks them, at some of the points. */
async function paintedMaterials({ view, points }: Gesture): Promise<string[]> {
  const image = stage.imageOf(view);
  const isFree = cameraOf(view) !== null;
  const every = isFree ? Math.ceil(points.length / MAX_PROBES) : 1;
  const materials = new Set<string>();
  for (const [x, y] of points.filter((_, k) => k % every === 0)) {
    const [px, py] = [Math.floor(x), Math.floor(y)];
    const material = isFree ? (await requestPixelProbe(view, px, py)).material : image.material(px, py);
    if (material !== null) materials.add(material);
  }
  return [...materials];
}

function sendGesture(current: Gesture, materials: string[] = []): void {
  const base = baseRequest(current.view, current.before);
  if (base === null) return;
  const kind = strokeKind.peek();
  const strokes: StrokeBody[] =
    current.points.length === 0
      ? []
      : [
          {
            kind,
            points: [...current.points],
            radius: current.radius,
            stops: strokeStops.peek(),
            color: [...strokeColor.peek()],
          },
        ];
  const needsPicture = strokes.length === 0 || kind === "reference";
  const change = kind === "color" || (needsPicture && changesColor.peek()) ? "color" : "intensity";
  const rotate = strokes.length === 0 && rotatesEnvironment.peek();
  const body = {
    ...base,
    strokes,
    change,
    rotate,
    materials,
    ...(needsPicture ? referenceBody() : {}),
  } satisfies SolveRequest;
  matchStatus.value = matchStatus.peek() === PREPARING ? PREPARING : matchStatus.peek() || SOLVING;
  requests.send({ body, gesture: current, isFinal: current.isEnded });
}

const LABELS: Record<StrokeKind, string> = {
  brighter: "Match · Brighter",
  darker: "Match · Darker",
  color: "Match · Color",
  reference: "Match · Reference picture",
};

function beginGesture(view: string, label: string, points: ImagePoint[], radius: number): Gesture | null {
  finishGesture();
  const before = look.peek();
  if (before === null) return null;
  return (gesture.value = { label, view, before, points, radius, isEnded: false });
}

/** Begin a stroke at a point of the image; `radius` in pixels of the image. */
export function beginStroke(view: string, point: ImagePoint, radius: number): void {
  const begun = beginGesture(view, LABELS[strokeKind.peek()], [point], radius);
  if (begun !== null) sendGesture(begun);
}

/** Continue the stroke; points close to the last one are skipped. */
export function extendStroke(point: ImagePoint): void {
  const current = gesture.peek();
  const last = current?.points.at(-1);
  if (current === null || last === undefined || current.isEnded || current.points.length >= MAX_POINTS) return;
  if (Math.hypot(point[0] - last[0], point[1] - last[1]) < current.radius / 4) return;
  const extended = Object.assign(current, { points: [...current.points, point] });
  gesture.value = { ...extended };
  gesture.value = extended;
  sendGesture(extended);
}

/** End the stroke; the answer to its last point makes it a step. */
export function endStroke(): void {
  const current = gesture.peek();
  if (current === null || current.isEnded) return;
  current.isEnded = true;
  if (!changesMaterials.peek()) return sendGesture(current);
  void reportErrors(async () => {
    try {
      const materials = await paintedMaterials(current);
      if (gesture.peek() === current) sendGesture(current, materials);
    } catch (error) {
      if (gesture.peek() === current) stopGesture();
      throw error;
    }
  });
}

/** Match the whole image to the reference picture. */
export function matchPicture(): void {
  if (referencePicture.peek() === null) return;
  const whole = beginGesture(activeViewName.peek(), LABELS.reference, [], 1);
  if (whole === null) return;
  matchStatus.value = SOLVING;
  endStroke();
}

/** Read a file as the reference picture, and match the whole image to it. */
export async function setReference(file: File): Promise<void> {
  const bytes = new Uint8Array(await file.arrayBuffer());
  const text = Array.from(bytes, (byte) => String.fromCharCode(byte)).join("");
  referencePicture.value = { name: file.name, image: btoa(text) };
  matchPicture();
}

function stopGesture(): void {
  if (gesture.peek() === null) return;
  gesture.value = null;
  cancelPreview();
}

/** Keep what an ended stroke has found so far, whose last answer may come later; cancel one that has not ended. */
function finishGesture(): void {
  if (!gesture.peek()?.isEnded) return stopGesture();
  gesture.value = null;
  commitPreview();
}

/** Escape: cancel the stroke, or close the tool if there is none. */
export function cancelMatch(): void {
  if (!isMatchOpen.peek()) return;
  if (gesture.peek() === null) isMatchOpen.value = false;
  else {
    stopGesture();
    matchStatus.value = "Canceled. The lights are as before.";
  }
}

export function toggleMatch(): void {
  batch(() => {
    finishGesture();
    isMatchOpen.value = !isMatchOpen.value;
  });
}

// the images of the lights are rendered when the tool opens, not with the first stroke
effect(() => {
  if (!isMatchOpen.value) return;
  void bake.value;
  const [view, current] = [activeViewName.value, look.peek()];
  const body = current === null || view === "" ? null : baseRequest(view, current);
  if (body === null) return;
  matchStatus.value = PREPARING;
  requests.send({ body, gesture: null, isFinal: false });
});
