/** Requests of a changing value: one at a time, then one for the newest value. */

export class LatestRequest<Input, Output> {
  private next: { input: Input } | null = null;
  private isBusy = false;
  private isClosed = false;

  constructor(
    private readonly request: (input: Input) => Promise<Output>,
    /** Receives each output, also of an input that is not the newest any more. */
    private readonly use: (output: Output) => Promise<void> | void,
    private readonly fail: (error: unknown) => void,
  ) {}

  send(input: Input): void {
    this.next = { input };
    if (!this.isBusy) void this.run();
  }

  close(): void {
    this.isClosed = true;
    this.next = null;
  }

  private async run(): Promise<void> {
    this.isBusy = true;
    while (this.next !== null) {
      const { input } = this.next;
      this.next = null;
      try {
        const output = await this.request(input);
        if (!this.isClosed) await this.use(output);
      } catch (error) {
        if (!this.isClosed) this.fail(error);
      }
    }
    this.isBusy = false;
  }
}
