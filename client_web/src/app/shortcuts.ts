/** All keyboard shortcuts: the key handler and the help panel read the same list. */
import { beginComment } from "../panels/collaboration/commentActions";
import { logarithmic, curveTool } from "../curve/curveView";
import { editValue } from "../edit/edit";
import { storeA, saveLook, swapWithA, toggleWipe } from "../panels/looks/abCompare";
import { exportPng } from "../panels/looks/exportImage";
import { toggleMatch } from "../panels/lights/match/match";
import { redo, undo } from "../panels/looks/undoRedo";
import { zoomActual, zoomBy, zoomFit } from "../render/zoom";
import { toggleSolo } from "../state/visibility/soloSources";
import { falseColor, handlesOpen, isReferenceShown, wipe } from "../state/display";
import { look } from "../state/look";
import { filmstripOpen, helpOpen, histogramOpen, inspectorOpen, scenePanelOpen, timelineOpen } from "../state/panels";
import { togglePlay } from "../panels/timeline/playback";
import { activeViewName, toggleSideBySide } from "../state/views";
import { toggleAreaProbe } from "../viewport/AreaProbe";
import { freeCameraOf, type FreeCamera } from "../viewport/cameras/freeCamera";
import { toggleNavigation } from "../viewport/cameras/navigation";
import { showNote, reportErrors } from "../ui/toasts";

export interface Shortcut {
  group: "Picture" | "Camera" | "Look" | "Compare" | "Curve" | "Panels";
  label: string;
  /** `KeyboardEvent.key`, prefixed with "Ctrl+" and "Shift+" if they matter. */
  keys: string[];
  run: () => void;
  /** For keys that act while held. */
  release?: () => void;
}

const THIRD_STOP = 1 / 3;

function changeExposure(stops: number): void {
  const exposure = look.value?.display.exposure ?? 0;
  editValue("Exposure", "/display/exposure", Number((exposure + stops).toFixed(6)));
}

function moveWipe(delta: number): void {
  if (wipe.value.isOn) wipe.value = { isOn: true, position: Math.min(1, Math.max(0, wipe.value.position + delta)) };
}

function toggleAllPanels(): void {
  const open = !(scenePanelOpen.value || inspectorOpen.value || filmstripOpen.value);
  scenePanelOpen.value = inspectorOpen.value = filmstripOpen.value = open;
}

function withFreeCamera(run: (camera: FreeCamera) => void): void {
  const freeCamera = freeCameraOf(activeViewName.peek());
  if (freeCamera === null) showNote("This view has a fixed camera. Bake with a free camera to move it.");
  else run(freeCamera);
}

export const SHORTCUTS: readonly Shortcut[] = [
  { group: "Picture", label: "Zoom in", keys: ["+", "="], run: () => zoomBy(1.25) },
  { group: "Picture", label: "Zoom out", keys: ["-"], run: () => zoomBy(1 / 1.25) },
  { group: "Picture", label: "Fit to window", keys: ["f"], run: zoomFit },
  { group: "Picture", label: "Actual size", keys: ["0"], run: zoomActual },
  { group: "Picture", label: "Views side by side", keys: ["v"], run: toggleSideBySide },
  { group: "Picture", label: "Exposure heat map", keys: ["e"], run: () => (falseColor.value = !falseColor.value) },
  {
    group: "Picture",
    label: "Histogram, waveform, parade",
    keys: ["h"],
    run: () => (histogramOpen.value = !histogramOpen.value),
  },
  { group: "Picture", label: "Area probe", keys: ["r"], run: toggleAreaProbe },
  { group: "Picture", label: "Solo selection", keys: ["s"], run: toggleSolo },
  { group: "Picture", label: "Light handles", keys: ["g"], run: () => (handlesOpen.value = !handlesOpen.value) },
  { group: "Picture", label: "Exposure −⅓ stop", keys: [","], run: () => changeExposure(-THIRD_STOP) },
  { group: "Picture", label: "Exposure +⅓ stop", keys: ["."], run: () => changeExposure(THIRD_STOP) },
  { group: "Picture", label: "Match lights", keys: ["u"], run: toggleMatch },
  { group: "Camera", label: "Walk or orbit", keys: ["o"], run: () => withFreeCamera(toggleNavigation) },
  { group: "Camera", label: "Go inside a room", keys: ["i"], run: () => withFreeCamera((camera) => camera.goInside()) },
  {
    group: "Camera",
    label: "Step through the wall ahead",
    keys: ["j"],
    run: () => withFreeCamera((camera) => void reportErrors(() => camera.stepThrough())),
  },
  { group: "Camera", label: "Previous camera", keys: ["b"], run: () => withFreeCamera((camera) => camera.goBack()) },
  { group: "Look", label: "Undo", keys: ["Ctrl+z"], run: () => void undo() },
  { group: "Look", label: "Redo", keys: ["Ctrl+Shift+z", "Ctrl+y"], run: () => void redo() },
  { group: "Look", label: "Save look", keys: ["Ctrl+s"], run: () => void saveLook() },
  { group: "Look", label: "Show a saved look", keys: Array.from("123456789"), run: () => undefined },
  { group: "Look", label: "Export PNG", keys: ["Ctrl+Shift+s"], run: () => void exportPng() },
  { group: "Look", label: "Timeline", keys: ["m"], run: () => (timelineOpen.value = !timelineOpen.value) },
  { group: "Look", label: "Play or pause timeline", keys: ["k"], run: togglePlay },
  { group: "Compare", label: "Store as A", keys: ["a"], run: storeA },
  { group: "Compare", label: "Swap A and B", keys: ["x"], run: swapWithA },
  { group: "Compare", label: "Wipe between A and B", keys: ["w"], run: toggleWipe },
  { group: "Compare", label: "Move wipe", keys: ["[", "]"], run: () => undefined },
  {
    group: "Compare",
    label: "Hold to show A",
    keys: ["c"],
    run: () => (isReferenceShown.value = true),
    release: () => (isReferenceShown.value = false),
  },
  { group: "Curve", label: "Points", keys: ["p"], run: () => (curveTool.value = "points") },
  { group: "Curve", label: "Draw", keys: ["d"], run: () => (curveTool.value = "draw") },
  { group: "Curve", label: "Scale and move a range", keys: ["t"], run: () => (curveTool.value = "stretch") },
  { group: "Curve", label: "Logarithmic scale", keys: ["l"], run: () => (logarithmic.value = !logarithmic.value) },
  { group: "Picture", label: "Comment at pointer", keys: ["n"], run: beginComment },
  { group: "Panels", label: "Hide panels", keys: ["\\"], run: toggleAllPanels },
  { group: "Panels", label: "Keyboard shortcuts", keys: ["?"], run: () => (helpOpen.value = !helpOpen.value) },
];

/** Keys of focused controls: listed here, handled by the controls. */
export const FOCUS_KEYS: readonly (readonly [label: string, keys: readonly string[]])[] = [
  ["Slider: step", ["←", "→"]],
  ["Slider: large step", ["Page Up", "Page Down"]],
  ["Slider: minimum, maximum", ["Home", "End"]],
  ["Slider: fine steps", ["Shift+←", "Shift+→"]],
  ["Slider: type a value", ["Enter", "0–9"]],
  ["Slider: reset", ["Delete"]],
  ["Curve point: angle", ["←", "→"]],
  ["Curve point: value by 2 %", ["↑", "↓"]],
  ["Curve point: value by 25 %", ["Page Up", "Page Down"]],
  ["Curve point: fine steps", ["Shift+arrow"]],
  ["Curve point: pick up, drop", ["Enter"]],
  ["Curve point: delete", ["Delete"]],
  ["Curve point: reset", ["R"]],
  ["Curve range: scale", ["↑", "↓"]],
  ["Curve range: move", ["←", "→"]],
  ["Light handle: select", ["Enter", "Space"]],
  ["Light handle: move", ["←", "→", "↑", "↓"]],
  ["Light handle: farther, nearer", ["Shift+↑", "Shift+↓"]],
  ["Area probe: move, by 10 px", ["←", "Ctrl+arrow"]],
  ["Area probe: resize", ["Shift+arrow"]],
  ["Comment pin: move", ["←", "→", "↑", "↓"]],
  ["Comment pin: move by 10 px", ["Shift+arrow"]],
  ["Picture: pan, or orbit camera", ["←", "→", "↑", "↓"]],
  ["Camera: pan", ["Shift+arrow"]],
  ["Camera: fly while the right button is held", ["W", "A", "S", "D", "Q", "E"]],
  ["Walking: walk, down, up", ["W", "A", "S", "D", "Q", "E"]],
  ["Walking: turn, step", ["←", "→", "↑", "↓"]],
  ["Walking: look up, down", ["Shift+↑", "Shift+↓"]],
  ["Walking: four times as fast", ["Shift"]],
  ["Camera: dolly in, out", ["+", "−"]],
  ["Camera: reset view", ["Home"]],
  ["Side-by-side view: show alone", ["Enter"]],
];

export function handleWipeKey(key: string): void {
  moveWipe(key === "[" ? -0.02 : 0.02);
}
