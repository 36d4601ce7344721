/** Over a view's image: a handle for each light, and the size and target of the selected one. */
import { useRef } from "preact/hooks";
import { toHex } from "../../render/color/colorMath";
import { beginDrag } from "../../session/prepare";
import type { ImageCanvas } from "../../render/canvas";
import { displayedWidth, toScreenPoint } from "../../render/zoomTransform";
import { transformOf } from "../../render/viewTransforms";
import type { Light, LightKind, Rgb, Triple } from "../../protocol";
import { displayedFrames, handlesOpen } from "../../state/display";
import { aimLocked } from "../../state/panels";
import { selectedLight, selectLight } from "../../state/selection";
import { views } from "../../state/views";
import { useDrag } from "../../ui/drag";
import { formatNumber } from "../../ui/scale";
import { projectionCameraOf, project, pushPoint, slidePoint, type ProjectionCamera } from "./lightProjection";
import { aimLight, anchorsOf, moveLight, lightOutline, type LightChange } from "./handleGeometry";
import { labelOf } from "./lightKinds";
import { changeLight, lightPath, lights, removeLight } from "./lightEdits";

/** Maps world points to the canvas, and drags on the canvas to world points. */
class HandleProjection {
  private readonly transform;
  private readonly size;

  constructor(
    readonly camera: ProjectionCamera,
    screen: ImageCanvas,
  ) {
    this.transform = transformOf(screen.image.view);
    this.size = screen.size();
  }

  project(point: Triple): [x: number, y: number] | null {
    const projected = project(this.camera, point);
    return projected === null ? null : toScreenPoint(this.transform, this.size, projected.u, projected.v);
  }

  /** An SVG path through points; empty if a point is behind the camera. */
  path(points: readonly Triple[]): string {
    const screenPoints = points.map((point) => this.project(point));
    if (screenPoints.length === 0 || screenPoints.some((screenPoint) => screenPoint === null)) return "";
    return `M${screenPoints.map((screenPoint) => (screenPoint as number[]).map((x) => x.toFixed(1)).join(" ")).join("L")}`;
  }

  /** A point dragged by pixels: parallel to the image, or with `away` upwards and away from the camera. */
  dragged(point: Triple, dx: number, dy: number, away: boolean): Triple {
    const width = displayedWidth(this.transform, this.size);
    const [du, dv] = [dx / width, (dy * this.size.aspect) / width];
    return away ? pushPoint(this.camera, point, Math.exp(-2 * dv)) : slidePoint(this.camera, point, du, dv);
  }
}

const STEP_PX = 6;
const STEPS: Record<string, [dx: number, dy: number]> = {
  ArrowLeft: [-STEP_PX, 0],
  ArrowRight: [STEP_PX, 0],
  ArrowUp: [0, -STEP_PX],
  ArrowDown: [0, STEP_PX],
};

/** Shapes of the handles: circle for point lights, cone for spots, square for panels, ellipse for discs, large circle for spheres, bar for tubes, rays for directional lights, diamond for targets. */
const SHAPES: Record<LightKind | "aim", string> = {
  point: "M-5 0a5 5 0 1 0 10 0a5 5 0 1 0 -10 0z",
  spot: "M-2 -6h4l4 11h-12z",
  rectangle: "M-5 -5h10v10h-10z",
  disc: "M-6 0a6 4 0 1 0 12 0a6 4 0 1 0 -12 0z",
  sphere: "M-6 0a6 6 0 1 0 12 0a6 6 0 1 0 -12 0z",
  tube: "M-7 -2h14v4h-14z",
  directional:
    "M-3.5 0a3.5 3.5 0 1 0 7 0a3.5 3.5 0 1 0 -7 0zM0 -5.5v-2.5M0 5.5v2.5M-5.5 0h-2.5M5.5 0h2.5M-4 -4l-1.7 -1.7M4 4l1.7 1.7M-4 4l-1.7 1.7M4 -4l1.7 -1.7",
  mesh: "",
  points: "",
  panels: "",
  directionals: "",
  surfaces: "",
  aim: "M0 -6l6 6l-6 6l-6 -6z",
};

interface HandleProps {
  projection: HandleProjection;
  name: string;
  light: Light;
  position: Triple;
  label: "Move" | "Aim";
  /** The light's changes when the handle is dragged to a point. */
  change: (to: Triple) => LightChange | null;
}

function LightHandle({ projection, name, light, position, label, change }: HandleProps) {
  const drag = useRef({ x: 0, y: 0, position });
  const go = (to: Triple) => {
    const changed = change(to);
    if (changed !== null) changeLight(label, name, changed);
  };
  const applyDrag = () => {
    selectLight(name);
    beginDrag(lightPath(name));
  };
  const dragHandlers = useDrag({
    begin(event) {
      if (event.button !== 0) return false;
      drag.current = { x: event.clientX, y: event.clientY, position };
      applyDrag();
      return true;
    },
    move(event) {
      const { x, y, position: from } = drag.current;
      const to = projection.dragged(from, event.clientX - x, event.clientY - y, event.shiftKey);
      drag.current = { x: event.clientX, y: event.clientY, position: to };
      go(to);
    },
  });
  const key = (event: KeyboardEvent) => {
    const step = STEPS[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (step !== undefined) {
      applyDrag();
      go(projection.dragged(position, ...step, event.shiftKey));
    } else if ((event.key === "Delete" || event.key === "Backspace") && !event.repeat) removeLight(name);
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  const screenPosition = projection.project(position);
  if (screenPosition === null) return null;
  const emittedColor = light.emission.map((value, channel) => value * (light.color[channel] as number)) as Rgb;
  const where = position.map(formatNumber).join(", ");
  return (
    <button
      class={`light-handle ${label.toLowerCase()} ${selectedLight.value === name ? "selected" : ""}`}
      style={{ transform: `translate(${screenPosition[0].toFixed(1)}px, ${screenPosition[1].toFixed(1)}px)` }}
      title={label === "Move" ? `${name}: ${labelOf(light.kind)}` : `Target of ${name}`}
      aria-roledescription="handle"
      aria-label={`${name}, ${label === "Move" ? "at" : "aims at"} ${where}. Arrow keys move it, Shift+↑↓ farther and nearer.`}
      {...dragHandlers}
      onClick={applyDrag}
      onKeyDown={key}
    >
      <svg viewBox="-9 -9 18 18" aria-hidden="true">
        <path
          d={SHAPES[label === "Move" ? light.kind : "aim"]}
          style={light.enabled ? { fill: toHex(emittedColor, 0) } : undefined}
        />
      </svg>
    </button>
  );
}

/** Outline of the selected light. */
function LightOutline({ projection, light }: { projection: HandleProjection; light: Light }) {
  const anchors = anchorsOf(light, projection.camera);
  const outline = projection.path(lightOutline(light));
  const aim = anchors?.target ? projection.path([anchors.position, anchors.target]) : "";
  return (
    <svg class="light-lines" aria-hidden="true">
      {outline !== "" && <path d={`${outline}Z`} />}
      {aim !== "" && <path class="aim" d={aim} />}
    </svg>
  );
}

export function LightHandles({ screen }: { screen: ImageCanvas }) {
  const all = lights.value;
  const info = views.value.find(({ name }) => name === screen.image.view);
  if (!handlesOpen.value || info === undefined || Object.keys(all).length === 0) return null;
  void displayedFrames.value; // the canvas may have changed size
  const projection = new HandleProjection(projectionCameraOf(info), screen);
  const { camera } = projection;
  const selected = selectedLight.value;
  const open = selected === null ? undefined : all[selected];
  return (
    <div class="light-handles">
      {open !== undefined && <LightOutline projection={projection} light={open} />}
      {Object.entries(all).map(([name, light]) => {
        const anchors = anchorsOf(light, camera);
        if (anchors === null) return null;
        const common = { projection, name, light };
        return [
          <LightHandle
            key={name}
            {...common}
            position={anchors.position}
            label="Move"
            change={(to) => moveLight(light, to, camera, aimLocked.value)}
          />,
          name === selected && anchors.target !== null && light.kind !== "directional" && (
            <LightHandle
              key={`aim ${name}`}
              {...common}
              position={anchors.target}
              label="Aim"
              change={(to) => aimLight(light, to)}
            />
          ),
        ];
      })}
    </div>
  );
}
