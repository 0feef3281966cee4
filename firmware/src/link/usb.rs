//! The part's own USB, full speed, as a serial port (CDC ACM): the connector beside the debugger's.

use embassy_stm32::peripherals::USB_OTG_FS;
use embassy_stm32::usb::{Config as DriverConfig, Driver};
use embassy_usb::class::cdc_acm::{CdcAcmClass, Receiver, Sender, State};
use embassy_usb::{Builder, Config, UsbDevice};

use crate::board::{Irqs, UsbPins};
use crate::design_parameters::{USB_PACKET, USB_PRODUCT, USB_VENDOR};

type Bus = Driver<'static, USB_OTG_FS>;

/// The device, run by a separate task.
pub type Usb = UsbDevice<'static, Bus>;

/// Buffers of the device, for its whole life.
pub struct Memory {
    output: [u8; 256],
    configuration: [u8; 128],
    control: [u8; 64],
    state: State<'static>,
}

impl Memory {
    /// Unused.
    pub fn new() -> Self {
        Self {
            output: [0; 256],
            configuration: [0; 128],
            control: [0; 64],
            state: State::new(),
        }
    }
}

impl Default for Memory {
    fn default() -> Self {
        Self::new()
    }
}

/// To the host.
pub struct Output(Sender<'static, Bus>);

impl Output {
    /// Sends all bytes; waits while the port is not open.
    pub async fn send(&mut self, bytes: &[u8]) {
        for packet in bytes.chunks(usize::from(USB_PACKET)) {
            self.0.wait_connection().await;
            if self.0.write_packet(packet).await.is_err() {
                // Unplugged: the host discards the garbled frame, and the next one begins with a zero.
                return;
            }
        }
        // A full last packet means that more follows, unless an empty packet comes after it.
        if bytes.len().is_multiple_of(usize::from(USB_PACKET)) {
            let _ = self.0.write_packet(&[]).await;
        }
    }
}

/// From the host.
pub struct Input(Receiver<'static, Bus>);

impl Input {
    /// The next bytes; `None` if some were lost. `bytes` has to have room for a packet.
    pub async fn receive(&mut self, bytes: &mut [u8]) -> Option<usize> {
        self.0.wait_connection().await;
        self.0.read_packet(bytes).await.ok()
    }
}

/// Both directions, and the device. `serial`: its serial number.
pub fn split(
    pins: UsbPins,
    serial: &'static str,
    memory: &'static mut Memory,
) -> (Output, Input, Usb) {
    let mut driver = DriverConfig::default();
    // The debugger's connector powers the part, so the voltage at this one is not checked.
    driver.vbus_detection = false;
    let UsbPins { controller, dp, dm } = pins;
    let bus = Driver::new_fs(controller, Irqs, dp, dm, &mut memory.output, driver);
    let mut config = Config::new(USB_VENDOR, USB_PRODUCT);
    config.product = Some("mimu");
    config.serial_number = Some(serial);
    let mut builder = Builder::new(
        bus,
        config,
        &mut memory.configuration,
        &mut [],
        &mut [],
        &mut memory.control,
    );
    let class = CdcAcmClass::new(&mut builder, &mut memory.state, USB_PACKET);
    let (output, input) = class.split();
    (Output(output), Input(input), builder.build())
}
