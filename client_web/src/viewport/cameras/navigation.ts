/** How the camera is moved: orbiting or walking, and whether walls stop it. */
import { signal } from "@preact/signals";
import { length, subtract } from "../../panels/lights/vector";
import type { Bounds, Orbit } from "./orbit";

export type NavigationMode = "orbit" | "walk";

const WALLS_KEY = "relume.stopsAtWalls";
const MARGIN = 0.005; // fraction of the scene's size
const MAX_MARGIN_M = 0.05;
const SPEED = 0.2; // fraction of the scene's size, per second
const MAX_SPEED_M = 2;
const STEP_S = 0.25; // of walking, per press of a button

export const navigation = signal<NavigationMode>("orbit");
export const stopsAtWalls = signal(loadStopsAtWalls());

/** A camera that moves. `slides`: along surfaces that are in the way. */
export interface Steerable {
  readonly bounds: Bounds;
  change: (update: (orbit: Orbit) => Orbit, slides?: boolean) => void;
}

function loadStopsAtWalls(): boolean {
  try {
    return localStorage.getItem(WALLS_KEY) !== "off";
  } catch {
    return true; // no storage
  }
}

export function setStopsAtWalls(stops: boolean): void {
  stopsAtWalls.value = stops;
  try {
    localStorage.setItem(WALLS_KEY, stops ? "on" : "off");
  } catch {
    // no storage: a reload stops at walls
  }
}

export function toggleNavigation(): void {
  navigation.value = navigation.peek() === "orbit" ? "walk" : "orbit";
}

const sizeOf = ({ lowest, highest }: Bounds): number => length(subtract(highest, lowest));

/** Least distance of the camera from surfaces, meters. */
export const wallMargin = (bounds: Bounds): number => Math.max(1e-6, Math.min(MAX_MARGIN_M, MARGIN * sizeOf(bounds)));

/** Meters per second. */
export const walkSpeed = (bounds: Bounds): number => Math.min(MAX_SPEED_M, SPEED * sizeOf(bounds));

/** Length of a single step, meters. */
export const walkStep = (bounds: Bounds): number => STEP_S * walkSpeed(bounds);
