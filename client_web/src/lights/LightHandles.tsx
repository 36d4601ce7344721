/** Over a view's picture: a handle for each light, and for the selected one its size and what it aims at. */
import { useRef } from "preact/hooks";
import { toHex } from "../color/color";
import { hold } from "../live/touch";
import type { Screen } from "../picture/screen";
import { shownWidth, toScreen } from "../picture/transform";
import { transformOf } from "../picture/viewTransforms";
import type { Light, LightKind, Rgb, Triple } from "../protocol";
import { drawn, handlesOpen } from "../state/display";
import { aimLocked } from "../state/panels";
import { selectedLight, selectLight } from "../state/selection";
import { views } from "../state/views";
import { useDrag } from "../ui/drag";
import { formatNumber } from "../ui/scale";
import { cameraOf, project, pushed, slid, type Camera } from "./camera";
import { aimed, anchorsOf, moved, outlineOf, type Change } from "./handleGeometry";
import { labelOf } from "./kinds";
import { changeLight, lightPath, lights, removeLight } from "./lights";

/** How a point of the world lies on a canvas, and how the canvas pulls at it. */
class Ground {
  private readonly transform;
  private readonly size;

  constructor(
    readonly camera: Camera,
    screen: Screen,
  ) {
    this.transform = transformOf(screen.picture.view);
    this.size = screen.size();
  }

  place(point: Triple): [x: number, y: number] | null {
    const seen = project(this.camera, point);
    return seen === null ? null : toScreen(this.transform, this.size, seen.u, seen.v);
  }

  /** A path through points; empty where a part of it is behind the camera. */
  path(points: readonly Triple[]): string {
    const places = points.map((point) => this.place(point));
    if (places.length === 0 || places.some((place) => place === null)) return "";
    return `M${places.map((place) => (place as number[]).map((x) => x.toFixed(1)).join(" ")).join("L")}`;
  }

  /** A point pulled by pixels: across the picture, or with `away` up and away from the camera. */
  pulled(point: Triple, dx: number, dy: number, away: boolean): Triple {
    const width = shownWidth(this.transform, this.size);
    const [du, dv] = [dx / width, (dy * this.size.aspect) / width];
    return away ? pushed(this.camera, point, Math.exp(-2 * dv)) : slid(this.camera, point, du, dv);
  }
}

const STEP_PX = 6;
const STEPS: Record<string, [dx: number, dy: number]> = {
  ArrowLeft: [-STEP_PX, 0],
  ArrowRight: [STEP_PX, 0],
  ArrowUp: [0, -STEP_PX],
  ArrowDown: [0, STEP_PX],
};

/** What a handle looks like: a bulb is round, a spot a cone, a panel a square, a sun has rays; an aim is a diamond. */
const SHAPES: Record<LightKind | "aim", string> = {
  point: "M-5 0a5 5 0 1 0 10 0a5 5 0 1 0 -10 0z",
  spot: "M-2 -6h4l4 11h-12z",
  rectangle: "M-5 -5h10v10h-10z",
  directional: "M-3.5 0a3.5 3.5 0 1 0 7 0a3.5 3.5 0 1 0 -7 0zM0 -5.5v-2.5M0 5.5v2.5M-5.5 0h-2.5M5.5 0h2.5M-4 -4l-1.7 -1.7M4 4l1.7 1.7M-4 4l-1.7 1.7M4 -4l1.7 -1.7",
  mesh: "",
  aim: "M0 -6l6 6l-6 6l-6 -6z",
};

interface HandleProps {
  ground: Ground;
  name: string;
  light: Light;
  at: Triple;
  deed: "Move" | "Aim";
  /** What pulling the handle to a point changes. */
  change(to: Triple): Change | null;
}

function Handle({ ground, name, light, at, deed, change }: HandleProps) {
  const drag = useRef({ x: 0, y: 0, at });
  const go = (to: Triple) => {
    const found = change(to);
    if (found !== null) changeLight(deed, name, found);
  };
  const take = () => {
    selectLight(name);
    hold(lightPath(name));
  };
  const hand = useDrag({
    begin(event) {
      if (event.button !== 0) return false;
      drag.current = { x: event.clientX, y: event.clientY, at };
      take();
      return true;
    },
    move(event) {
      const { x, y, at: from } = drag.current;
      const to = ground.pulled(from, event.clientX - x, event.clientY - y, event.shiftKey);
      drag.current = { x: event.clientX, y: event.clientY, at: to };
      go(to);
    },
  });
  const key = (event: KeyboardEvent) => {
    const step = STEPS[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (step !== undefined) {
      take();
      go(ground.pulled(at, ...step, event.shiftKey));
    }
    else if ((event.key === "Delete" || event.key === "Backspace") && !event.repeat) removeLight(name);
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  const place = ground.place(at);
  if (place === null) return null;
  const lit = light.emission.map((value, channel) => value * (light.color[channel] as number)) as Rgb;
  const where = at.map(formatNumber).join(", ");
  return (
    <button
      class={`light-handle ${deed.toLowerCase()} ${selectedLight.value === name ? "selected" : ""}`}
      style={{ transform: `translate(${place[0].toFixed(1)}px, ${place[1].toFixed(1)}px)` }}
      title={deed === "Move" ? `${name}: ${labelOf(light.kind)}` : `What ${name} aims at`}
      aria-roledescription="handle"
      aria-label={`${name}, ${deed === "Move" ? "at" : "aims at"} ${where}. Arrow keys move it, with Shift away and near.`}
      {...hand}
      onClick={take}
      onKeyDown={key}
    >
      <svg viewBox="-9 -9 18 18" aria-hidden="true">
        <path d={SHAPES[deed === "Move" ? light.kind : "aim"]} style={light.on ? { fill: toHex(lit, 0) } : undefined} />
      </svg>
    </button>
  );
}

/** The lines of the selected light. */
function Lines({ ground, light }: { ground: Ground; light: Light }) {
  const anchors = anchorsOf(light, ground.camera);
  const outline = ground.path(outlineOf(light));
  const aim = anchors?.target ? ground.path([anchors.at, anchors.target]) : "";
  return (
    <svg class="light-lines" aria-hidden="true">
      {outline !== "" && <path d={`${outline}Z`} />}
      {aim !== "" && <path class="aim" d={aim} />}
    </svg>
  );
}

export function LightHandles({ screen }: { screen: Screen }) {
  const all = lights.value;
  const info = views.value.find(({ name }) => name === screen.picture.view);
  if (!handlesOpen.value || info === undefined || Object.keys(all).length === 0) return null;
  drawn.value; // the canvas may have another size
  const ground = new Ground(cameraOf(info), screen);
  const { camera } = ground;
  const selected = selectedLight.value;
  const open = selected === null ? undefined : all[selected];
  return (
    <div class="light-handles">
      {open !== undefined && <Lines ground={ground} light={open} />}
      {Object.entries(all).map(([name, light]) => {
        const anchors = anchorsOf(light, camera);
        if (anchors === null) return null;
        const common = { ground, name, light };
        return [
          <Handle key={name} {...common} at={anchors.at} deed="Move" change={(to) => moved(light, to, camera, aimLocked.value)} />,
          name === selected && anchors.target !== null && light.kind !== "directional" && (
            <Handle
              key={`aim ${name}`}
              {...common}
              at={anchors.target}
              deed="Aim"
              change={(to) => aimed(light, to)}
            />
          ),
        ];
      })}
    </div>
  );
}
