/** What the editor knows, as signals. Functions that change it live beside it, one concern per file. */
import { computed, effect, signal } from "@preact/signals";
import type { Connection } from "../net/session";
import type { Transform } from "../picture/transform";
import type { BakeBody, CurveMessage, Fidelity, HelloMessage, Look, ModelBody, ProbeAnswer, SceneBody, Term, Transport } from "../protocol";
import type { Baking } from "../start/baking";
import { History } from "./history";
import { pointer } from "./pointer";

export const page = signal<"start" | "editor">("start");
export const models = signal<ModelBody[]>([]);
export const scene = signal<SceneBody | null>(null);

/** The bake that the picture shows, and which light it has; and one that is on its way. */
export const bake = signal<string | null>(null);
export const method = signal<string | null>(null);
export const coming = signal<Baking | null>(null);
export const bakes = signal<BakeBody[]>([]);

export const views = signal<HelloMessage["views"]>([]);
/** The active view: what buttons and keys mean. It is one of those that are shown. */
export const viewName = signal("");
export const shownViews = signal<string[]>([]);
export const sideBySide = computed(() => shownViews.value.length > 1);
/** The view that the pointer is over. */
export const pointedView = signal<string | null>(null);
/** The view whose frames go first. */
export const focusedView = computed(() => {
  const pointed = pointedView.value;
  return pointed !== null && shownViews.value.includes(pointed) ? pointed : viewName.value;
});
export const view = computed(() => views.value.find((v) => v.name === viewName.value) ?? null);

export const look = signal<Look | null>(null);
/** The look's part that costs no round trip; apart, so that other edits do not redraw the picture twice. */
export const exposure = computed(() => look.value?.display.exposure ?? 0);
export const toneMap = computed(() => look.value?.display.tone_map ?? "agx");
/** The scene's own look, for resets. */
export const defaultLook = signal<Look | null>(null);
export const history = new History();

export const selectedMaterial = signal<string | null>(null);
/** The inspector shows a light or a material. */
export const selectedLight = signal<string | null>(null);
export const selectedTerm = signal(0);
export const selectedCurve = signal<string | null>(null);
export const hoveredMaterial = signal<string | null>(null);
export const materialNames = computed(() => scene.value?.materials.map((m) => m.name) ?? []);

export const terms = computed<Term[]>(() => {
  const name = selectedMaterial.value;
  return name === null ? [] : (look.value?.materials[name]?.terms ?? []);
});

/** Pointer of the curve that is open, null where none is. */
export const curvePath = computed(() => {
  const [material, curve] = [selectedMaterial.value, selectedCurve.value];
  const term = terms.value[selectedTerm.value];
  if (material === null || curve === null || term === undefined) return null;
  if (look.value?.materials[material]?.catcher) return null; // of a catcher's terms nothing is seen
  if (!modelOf(term)?.curves.some((info) => info.name === curve)) return null;
  return pointer("materials", material, "terms", selectedTerm.value, "curves", curve);
});
export const curveShape = signal<CurveMessage | null>(null);
/** A stretch of the open curve whose pixels are tinted, degrees. */
export const brushed = signal<[from: number, to: number] | null>(null);

/** Where each view's picture lies when it is alone, and when it is beside others; fitted where nothing is said. */
export const alonePlaces = signal<ReadonlyMap<string, Transform>>(new Map());
export const besidePlaces = signal<ReadonlyMap<string, Transform>>(new Map());
export const falseColour = signal(false);
/** The material that is shown alone, the others in dim grey; display only, no edit. */
export const solo = signal<string | null>(null);
/** The source of light that is seen alone, see `solo.ts`; no edit either. */
export const soloLight = signal<string | null>(null);
/** The light paths that are seen in place of the look's own, see `paths.ts`; no edit either. */
export const seenPaths = signal<Transport | null>(null);
/** Whether lights have handles in the picture. */
export const handlesOpen = signal(true);
export const wipe = signal<{ on: boolean; at: number }>({ on: false, at: 0.5 });
export const showBefore = signal(false);
export const probe = signal<{ view: string; x: number; y: number; answer: ProbeAnswer | null } | null>(null);

export const connection = signal<Connection>("connecting");
export const retryInMs = signal(0);
/** What takes time on the server: a curve that is frozen, or a term that is shaded for the first time. */
export const freezing = signal<{
  state: "freezing" | "shading";
  view: string;
  what: string;
  progress: number;
} | null>(null);
/** Whether every shown picture equals the look. */
export const exact = signal(false);
/** Exact, and for a moment: what the status bar says, so that it stands still while a hand drags. */
export const settled = signal(false);
/** How near the shown pictures are to the look, the worst of them; of no picture nothing bad is said. */
export const fidelity = signal<Fidelity>("exact");
/** Whether the light is the one that the bake was made for; in another one "exact" is said of the bake's own answer. */
export const bakedLight = computed(() => (look.value?.environment.map ?? null) === null);
export const latencyMs = signal<number | null>(null);
/** While frames of another look are fetched, the screens keep what they show. */
export const held = signal(false);
/** Counts up with every frame that is drawn. */
export const drawn = signal(0);

export const helpOpen = signal(false);

export function modelOf(term: Term): ModelBody | undefined {
  return models.value.find((model) => model.model === term.model);
}

const SETTLED_MS = 250;
effect(() => {
  if (!exact.value) {
    settled.value = false;
    return undefined;
  }
  const timer = setTimeout(() => (settled.value = true), SETTLED_MS);
  return () => clearTimeout(timer);
});
