/** Line icons on a 16 px grid, drawn in the text's color. */
const PATHS = {
  undo: "M3 6.5h6.5a3.5 3.5 0 0 1 0 7H6M3 6.5l3-3M3 6.5l3 3",
  redo: "M13 6.5H6.5a3.5 3.5 0 0 0 0 7H10M13 6.5l-3-3M13 6.5l-3 3",
  wipe: "M2.5 3.5h11v9h-11zM8 2v12M8 8h4",
  link: "M6.5 9.5l3-3M7 5l1.5-1.5a2.5 2.5 0 0 1 3.5 3.5L10.5 8.5M9 11l-1.5 1.5A2.5 2.5 0 0 1 4 9l1.5-1.5",
  unlink: "M7 5l1.5-1.5a2.5 2.5 0 0 1 3.5 3.5L10.5 8.5M9 11l-1.5 1.5A2.5 2.5 0 0 1 4 9l1.5-1.5M3 3l2 2M11 11l2 2",
  close: "M4 4l8 8M12 4l-8 8",
  plus: "M8 3v10M3 8h10",
  reset: "M4 3.5v3h3M4.3 6.3A4.5 4.5 0 1 1 3.5 9",
  share: "M9.5 3H13v3.5M13 3L7.5 8.5M11.5 9v3.5h-8v-8H7",
  download: "M8 2.5v7M5 7l3 3 3-3M3 13h10",
  left: "M2.5 3h11v10h-11zM6 3v10",
  right: "M2.5 3h11v10h-11zM10 3v10",
  bottom: "M2.5 3h11v10h-11zM2.5 10h11",
  grid: "M2.5 3h11v10h-11zM8 3v10M2.5 8h11",
  trash: "M3.5 4.5h9M6.5 4.5v-2h3v2M5 4.5l.5 9h5l.5-9",
  draw: "M3 13c1-5 2.5-7 4-7s1 4 2.5 4S12 6 13 3",
  points: "M2.5 12.5c3 0 3-9 5.5-9s2.5 6 5.5 6M8 2.2a1.3 1.3 0 1 0 .01 0",
  stretch: "M5 3v10M11 3v10M6.5 8h3M8 5v6M7 6l1-1 1 1M7 10l1 1 1-1",
  view: "M1.5 8S4 4 8 4s6.5 4 6.5 4S12 12 8 12 1.5 8 1.5 8zM8 6.3a1.7 1.7 0 1 0 .01 0",
  solo: "M2 8a6 6 0 1 0 12 0a6 6 0 1 0-12 0M5.5 8a2.5 2.5 0 1 0 5 0a2.5 2.5 0 1 0-5 0",
  copy: "M6 6h7v7H6zM10 6V3H3v7h3",
  lock: "M4 7.5h8v6H4zM5.5 7.5V5.5a2.5 2.5 0 0 1 5 0v2",
  light: "M6 11V9.6a4 4 0 1 1 4 0V11zM6.5 13.5h3",
  handles: "M8 2.5v11M2.5 8h11M6.5 4L8 2.5 9.5 4M6.5 12L8 13.5 9.5 12M4 6.5L2.5 8 4 9.5M12 6.5L13.5 8 12 9.5",
  wide: "M6 4L2.5 8 6 12M10 4l3.5 4L10 12",
  table: "M2.5 3.5h11v9h-11zM2.5 6.5h11M2.5 9.5h11M8 3.5v9",
  back: "M10 3L5 8l5 5",
  save: "M3 3h8l2 2v8H3zM5.5 3v3.5h4V3M5.5 13V9.5h5V13",
  more: "M3.5 8h.01M8 8h.01M12.5 8h.01",
  play: "M5 3l8 5-8 5z",
  pause: "M5.5 3v10M10.5 3v10",
  loop: "M3 9.5V8a2.5 2.5 0 0 1 2.5-2.5H13M10.5 3L13 5.5 10.5 8M13 8v.5a2.5 2.5 0 0 1-2.5 2.5H3M5.5 13.5L3 11l2.5-2.5",
  earlier: "M10 4L6 8l4 4",
  later: "M6 4l4 4-4 4",
  film: "M2.5 3.5h11v9h-11zM5.5 3.5v9M10.5 3.5v9M2.5 8h3M10.5 8h3",
  people:
    "M5.5 7.5a2 2 0 1 0-.01 0M1.5 13c0-2.5 1.8-4 4-4s4 1.5 4 4M10.8 8a1.8 1.8 0 1 0-.01 0M11 9.6c2 0 3.5 1.3 3.5 3.4",
  help: "M6 6a2 2 0 1 1 2.6 1.9c-.4.2-.6.5-.6 1v.6M8 12v.1",
} as const;

export type IconName = keyof typeof PATHS;

export function Icon({ name }: { name: IconName }) {
  return (
    <svg class="glyph" width="16" height="16" viewBox="0 0 16 16" aria-hidden="true">
      <path d={PATHS[name]} />
    </svg>
  );
}
