/** Pictures of where a camera is: one is asked for at a time, and then the newest. */
import type { Size } from "../scene/recipe";
import type { Frame } from "./orbit";

interface Wanted {
  frame: Frame;
  size: Size;
}

export class Pictures {
  private next: Wanted | null = null;
  private isBusy = false;
  private isClosed = false;

  constructor(
    private readonly ask: (frame: Frame, size: Size) => Promise<Blob>,
    private readonly draw: (picture: Blob) => Promise<void>,
    private readonly fail: (error: unknown) => void,
  ) {}

  show(frame: Frame, size: Size): void {
    this.next = { frame, size };
    if (!this.isBusy) void this.run();
  }

  close(): void {
    this.isClosed = true;
    this.next = null;
  }

  private async run(): Promise<void> {
    this.isBusy = true;
    while (this.next !== null) {
      const { frame, size } = this.next;
      this.next = null;
      try {
        const picture = await this.ask(frame, size);
        if (!this.isClosed) await this.draw(picture);
      } catch (error) {
        if (!this.isClosed) this.fail(error);
      }
    }
    this.isBusy = false;
  }
}
