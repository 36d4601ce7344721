/** The navigation map of fitted materials: each point is a material, applied to the selected object. */
import { useEffect, useRef, useState } from "preact/hooks";
import { getMaterialMap, getMaterialAt } from "../../session/net/api";
import type { MaterialMapBody } from "../../protocol";
import { selectedMaterial, selectedTerms } from "../../state/selection";
import { useDrag } from "../../ui/drag";
import { RadioRow } from "../../ui/RadioRow";
import { reportErrors, showNote } from "../../ui/toasts";
import { applyTerms, library } from "./libraryItems";
import { addPathPoint, addPathToTimeline, isDrawingPath, mapTable, pathLine, pathPoints } from "./mapPath";
import {
  highlightOf,
  positionOf,
  highlightAt,
  mapRange,
  type Highlight,
  type HighlightRange,
  type MapPosition,
} from "./navigationMap";

const [WIDTH, HEIGHT] = [288, 180];
const MARGIN = 6;
const STEP = 0.01;
const MIDDLE: MapPosition = { x: 0.5, y: 0.5 };

const clamp = (fraction: number) => Math.min(1, Math.max(0, fraction));
const clampToPlane = ({ x, y }: MapPosition): MapPosition => ({ x: clamp(x), y: clamp(y) });
const highlightText = ({ f0, sigma }: Highlight) =>
  `reflectance ${(100 * f0).toFixed(1)} %, roughness ${sigma.toFixed(3)}`;

/** Position of the pointer in the unit square; outside of it in the margin. */
function positionUnder(event: PointerEvent & { currentTarget: Element }): MapPosition {
  const box = event.currentTarget.getBoundingClientRect();
  const along = (fraction: number, length: number) => (fraction * (length + 2 * MARGIN) - MARGIN) / length;
  return {
    x: along((event.clientX - box.left) / box.width, WIDTH),
    y: along((event.clientY - box.top) / box.height, HEIGHT),
  };
}

/** Request only the newest point: a response superseded by a later move is dropped. `done` when none is pending. */
function useMaterialChoice(range: HighlightRange | null, done: () => void) {
  const newest = useRef(0);
  return async (point: MapPosition) => {
    const target = selectedMaterial.value;
    if (range === null) return;
    if (target === null) return showNote("Select a material in the scene first.");
    const requestNumber = ++newest.current;
    const { f0, sigma } = highlightAt(point, range);
    await reportErrors(async () => {
      const material = await getMaterialAt(f0, sigma, mapTable.peek());
      if (requestNumber === newest.current) applyTerms(target, "Material map", material);
    });
    if (requestNumber === newest.current) done();
  };
}

function MapPlane({ map, range }: { map: MaterialMapBody; range: HighlightRange }) {
  const positions = map.points.map((point) => positionOf(point, range));
  const coordinatesOf = (k: number) => `${(positions[k]?.x ?? 0) * WIDTH},${(positions[k]?.y ?? 0) * HEIGHT}`;
  const swatches = new Map(library.value.map((material) => [material.id, material]));
  return (
    <>
      {map.triangles.map((corners) => (
        <polygon key={corners.join()} points={corners.map(coordinatesOf).join(" ")} />
      ))}
      {map.points.map((point, k) => (
        <circle
          key={point.id}
          cx={(positions[k]?.x ?? 0) * WIDTH}
          cy={(positions[k]?.y ?? 0) * HEIGHT}
          r={4}
          fill={swatches.get(point.id)?.swatch ?? "#888"}
        >
          <title>{swatches.get(point.id)?.name ?? point.id}</title>
        </circle>
      ))}
    </>
  );
}

const TABLES = [
  { value: "ngan", label: "Ngan", title: "Fits of Ngan et al. 2005, as in Sun et al. 2007; metals have extinction" },
  { value: "low", label: "Löw", title: "Fits of Löw et al. 2012, without extinction" },
] as const;

/** The drawn path, as materials take it. */
function DrawnPath({ range }: { range: HighlightRange }) {
  const scaled = ({ x, y }: MapPosition) => `${x * WIDTH},${y * HEIGHT}`;
  return (
    <>
      <polyline points={pathLine(pathPoints.value, range).map(scaled).join(" ")} />
      {pathPoints.value.map((point, k) => {
        const { x, y } = positionOf(point, range);
        return <circle key={k} class="path-point" cx={x * WIDTH} cy={y * HEIGHT} r={3} />;
      })}
    </>
  );
}

/** Choice of the table, and the tools of a path. */
function MapTools({ range }: { range: HighlightRange }) {
  const [material, num] = [selectedMaterial.value, pathPoints.value.length];
  return (
    <div class="material-map-tools">
      <RadioRow
        label="Fits on the map"
        choices={TABLES}
        selected={mapTable.value}
        onSelect={(table) => {
          [mapTable.value, pathPoints.value] = [table, []];
        }}
      />
      <button
        aria-pressed={isDrawingPath.value}
        title="Click points of a path on the map, or press Enter at the current one; the timeline moves the selected material along it"
        onClick={() => (isDrawingPath.value = !isDrawingPath.value)}
      >
        Path
      </button>
      {num > 0 && (
        <>
          <button onClick={() => (pathPoints.value = pathPoints.value.slice(0, -1))}>Undo point</button>
          <button
            disabled={num < 2 || material === null}
            title={material === null ? "Select a material first" : `Keyframes of ${material}, at constant speed`}
            onClick={() => material !== null && void reportErrors(() => addPathToTimeline(material, range))}
          >
            To timeline
          </button>
        </>
      )}
    </div>
  );
}

export function NavigationMap() {
  const [map, setMap] = useState<MaterialMapBody | null>(null);
  const [pendingPoint, setPendingPoint] = useState<MapPosition | null>(null); // until the material is applied
  const table = mapTable.value;
  useEffect(
    () =>
      void reportErrors(async () => {
        const answer = await getMaterialMap(table);
        if (mapTable.peek() === table) setMap(answer);
      }),
    [table],
  );
  const range = map === null ? null : mapRange(map.points);
  const choose = useMaterialChoice(range, () => setPendingPoint(null));
  const currentHighlight = highlightOf(selectedTerms.value);
  const position =
    pendingPoint ??
    (currentHighlight === null || range === null ? null : clampToPlane(positionOf(currentHighlight, range)));
  const go = (x: number, y: number) => {
    const next = clampToPlane({ x, y });
    if (selectedMaterial.peek() !== null) setPendingPoint(next);
    void choose(next);
  };
  const point = (event: PointerEvent & { currentTarget: Element }) => {
    const { x, y } = positionUnder(event);
    go(x, y);
  };
  const drag = useDrag({
    begin(event) {
      if (event.button !== 0) return false;
      if (isDrawingPath.peek()) {
        if (range !== null) addPathPoint(positionUnder(event), range);
        return false;
      }
      point(event);
      return true;
    },
    move: point,
  });
  const key = (event: KeyboardEvent) => {
    if (event.key === "Enter" && isDrawingPath.peek() && range !== null) addPathPoint(position ?? MIDDLE, range);
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    const size = event.shiftKey ? STEP / 5 : STEP;
    const from = position ?? MIDDLE;
    go(from.x + size * (step[0] as number), from.y + size * (step[1] as number));
  };
  if (map === null || range === null) return <p>Loading the map…</p>;
  const valueText = position === null ? "Not on the map" : highlightText(highlightAt(position, range));
  return (
    <div class="material-map">
      <svg
        viewBox={`${-MARGIN} ${-MARGIN} ${WIDTH + 2 * MARGIN} ${HEIGHT + 2 * MARGIN}`}
        tabindex={0}
        role="application"
        aria-label={`Material map; arrow keys move the point. Now ${valueText}`}
        onKeyDown={key}
        {...drag}
      >
        <MapPlane map={map} range={range} />
        <DrawnPath range={range} />
        {position !== null && <circle class="here" cx={position.x * WIDTH} cy={position.y * HEIGHT} r={6} />}
      </svg>
      <p class="material-map-text">
        {valueText} <span>right: more reflective, down: rougher</span>
      </p>
      <MapTools range={range} />
    </div>
  );
}
